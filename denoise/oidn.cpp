#include "denoise/oidn.h"

#include <dlfcn.h>

#include <array>
#include <cstdint>
#include <memory>
#include <stdexcept>

#include "denoise/error_estimate.h"

namespace relief {

namespace {

/// What is used of the library, with its own names.
struct Oidn {
  using Device = void*;
  using Filter = void*;
  static constexpr int kDeviceDefault = 0, kFormatFloat3 = 3;

  Device (*new_device)(int type) = nullptr;
  void (*commit_device)(Device) = nullptr;
  int (*get_device_error)(Device, const char** message) = nullptr;
  void (*release_device)(Device) = nullptr;
  Filter (*new_filter)(Device, const char* type) = nullptr;
  void (*set_image)(Filter,
                    const char* name,
                    void*,
                    int format,
                    std::size_t width,
                    std::size_t height,
                    std::size_t byte_offset,
                    std::size_t pixel_stride,
                    std::size_t row_stride) = nullptr;
  void (*set_bool)(Filter, const char* name, bool value) = nullptr;
  void (*set_progress_monitor)(Filter, bool (*goes_on)(void* user, double share), void* user) = nullptr;
  void (*commit_filter)(Filter) = nullptr;
  void (*execute_filter)(Filter) = nullptr;
  void (*release_filter)(Filter) = nullptr;
};

template <class Function>
void find(void* library, const std::string& name, const char* symbol, Function& function)
{
  void* address = dlsym(library, symbol);
  if (address == nullptr) throw std::runtime_error(name + ": expected the function " + symbol + ", which it lacks");
  static_assert(sizeof function == sizeof address);
  __builtin_memcpy(&function, &address, sizeof address);
}

/// The name that the library has of two for one function: version 2 renamed some.
const char* known_symbol(void* library, const char* first, const char* second)
{
  return dlsym(library, first) != nullptr ? first : second;
}

Oidn oidn_load()
{
  std::string names;
  for (const std::string& name : oidn_library_names()) {
    names += (names.empty() ? "" : ", ") + name;
    // Never closed: its threads outlive what is done with them.
    void* library = dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) continue;
    Oidn oidn;
    find(library, name, "oidnNewDevice", oidn.new_device);
    find(library, name, "oidnCommitDevice", oidn.commit_device);
    find(library, name, "oidnGetDeviceError", oidn.get_device_error);
    find(library, name, "oidnReleaseDevice", oidn.release_device);
    find(library, name, "oidnNewFilter", oidn.new_filter);
    find(library, name, "oidnSetSharedFilterImage", oidn.set_image);
    find(library, name, known_symbol(library, "oidnSetFilterBool", "oidnSetFilter1b"), oidn.set_bool);
    find(library, name, "oidnSetFilterProgressMonitorFunction", oidn.set_progress_monitor);
    find(library, name, "oidnCommitFilter", oidn.commit_filter);
    find(library, name, "oidnExecuteFilter", oidn.execute_filter);
    find(library, name, "oidnReleaseFilter", oidn.release_filter);
    return oidn;
  }
  throw std::runtime_error("Open Image Denoise: expected one of the libraries " + names +
                           " where the dynamic linker looks ($LD_LIBRARY_PATH), found none");
}

/// Three planes as pixels.
std::vector<float> interleaved(const ColorPlanes& planes)
{
  std::vector<float> pixels;
  pixels.reserve(3 * static_cast<std::size_t>(planes[0].width()) * static_cast<std::size_t>(planes[0].height()));
  for (int y = 0; y < planes[0].height(); ++y) {
    for (int x = 0; x < planes[0].width(); ++x) {
      for (const Plane& plane : planes) pixels.push_back(plane.row(y)[x]);
    }
  }
  return pixels;
}

ColorPlanes features_of(const DenoiseInput& input, std::size_t first)
{
  ColorPlanes planes = color_planes(input.width, input.height);
  for (std::size_t c = 0; c < 3; ++c) {
    for_pixels(planes[c], [&](int x, int y) { planes[c].row(y)[x] = input.features[first + c].at(x, y); });
  }
  return planes;
}

/// One device with one filter, which denoises pictures of one size.
class Session {
 public:
  explicit Session(const DenoiseInput& input)
      : oidn_(oidn_load()),
        input_(input),
        width_(input.width),
        height_(input.height),
        albedo_(interleaved(features_of(input, 0))),
        normal_(interleaved(features_of(input, 3))),
        device_(oidn_.new_device(Oidn::kDeviceDefault), oidn_.release_device)
  {
    if (device_ == nullptr) throw std::runtime_error("Open Image Denoise: no device");
    oidn_.commit_device(device_.get());
    check();
  }

  ColorPlanes denoise(const ColorPlanes& color) const
  {
    std::vector<float> pixels = interleaved(color), output(pixels.size());
    const std::unique_ptr<void, void (*)(void*)> filter(oidn_.new_filter(device_.get(), "RT"), oidn_.release_filter);
    check();
    const auto set = [&](const char* name, const std::vector<float>& image) {
      // It takes pointers that are not const, and reads.
      void* data = const_cast<float*>(image.data());
      oidn_.set_image(filter.get(), name, data, Oidn::kFormatFloat3, static_cast<std::size_t>(width_),
                      static_cast<std::size_t>(height_), 0, 0, 0);
    };
    set("color", pixels);
    set("albedo", albedo_);
    set("normal", normal_);
    set("output", output);
    oidn_.set_bool(filter.get(), "hdr", true);
    oidn_.set_progress_monitor(filter.get(), goes_on, const_cast<DenoiseInput*>(&input_));
    oidn_.commit_filter(filter.get());
    oidn_.execute_filter(filter.get());
    denoise_check_stop(input_);
    check();
    ColorPlanes planes = color_planes(width_, height_);
    for (std::size_t c = 0; c < 3; ++c) {
      for_pixels(planes[c], [&](int x, int y) {
        const std::size_t pixel =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
        planes[c].row(y)[x] = output[3 * pixel + c];
      });
    }
    return planes;
  }

 private:
  /// Asked by the library now and then. @param input  DenoiseInput
  static bool goes_on(void* input, double) { return !static_cast<const DenoiseInput*>(input)->is_stopped(); }

  void check() const
  {
    const char* message = nullptr;
    if (oidn_.get_device_error(device_.get(), &message) == 0) return;
    throw std::runtime_error(std::string("Open Image Denoise: ") + (message == nullptr ? "it failed" : message));
  }

  Oidn oidn_;
  const DenoiseInput& input_;
  int width_, height_;
  std::vector<float> albedo_, normal_;
  std::unique_ptr<void, void (*)(void*)> device_;
};

}  // namespace

std::vector<std::string> oidn_library_names()
{
  return {"libOpenImageDenoise.so.2", "libOpenImageDenoise.so.1", "libOpenImageDenoise.so.0", "libOpenImageDenoise.so"};
}

void oidn_require() { oidn_load(); }

DenoiseResult denoise_oidn(const DenoiseInput& input)
{
  const Session session(input);
  Halves halves = halves_make(input);
  find_independent_parts(halves);
  ColorPlanes mean = color_planes(input.width, input.height);
  for (std::size_t c = 0; c < 3; ++c) {
    for_pixels(mean[c], [&](int x, int y) { mean[c].row(y)[x] = halves.mean(c, x, y); });
  }
  Candidate picture(input.width, input.height);
  picture.color = session.denoise(mean);
  const ColorPlanes even = session.denoise(halves.color[0]), odd = session.denoise(halves.color[1]);
  for (std::size_t c = 0; c < 3; ++c) {
    for_pixels(even[c], [&](int x, int y) { picture.difference[c].row(y)[x] = even[c].row(y)[x] - odd[c].row(y)[x]; });
  }
  DenoiseResult result;
  result.color = interleaved(picture.color);
  error_estimate(halves, picture, result);
  return result;
}

}  // namespace relief
