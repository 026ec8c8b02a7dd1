// Stands in for Open Image Denoise: the functions that are used of it, with its calling convention. Its filter doubles what
// it is given where the albedo's red is at most 1, so that it can be seen that all arrived; and fails where it is more.
#include <cstddef>
#include <cstring>
#include <string>

namespace {

struct Filter {
  const float *color = nullptr, *albedo = nullptr, *normal = nullptr;
  float* output = nullptr;
  std::size_t num_pixels = 0;
  bool (*goes_on)(void*, double) = nullptr;
  void* user = nullptr;
  bool is_hdr = false, is_committed = false;
};

int g_device;
std::string g_error;

}  // namespace

extern "C" {

void* oidnNewDevice(int type) { return type == 0 ? &g_device : nullptr; }
void oidnCommitDevice(void*) {}
int oidnGetDeviceError(void*, const char** message)
{
  static std::string told;
  told = g_error;
  g_error.clear();
  *message = told.c_str();
  return told.empty() ? 0 : 1;
}
void oidnReleaseDevice(void*) {}
void* oidnNewFilter(void*, const char* type)
{
  if (std::strcmp(type, "RT") != 0) g_error = "unknown filter";
  return new Filter;
}
void oidnSetSharedFilterImage(void* filter,
                              const char* name,
                              void* data,
                              int format,
                              std::size_t width,
                              std::size_t height,
                              std::size_t byte_offset,
                              std::size_t pixel_stride,
                              std::size_t row_stride)
{
  auto& to = *static_cast<Filter*>(filter);
  if (format != 3 || byte_offset != 0 || pixel_stride != 0 || row_stride != 0) g_error = "unexpected format";
  to.num_pixels = width * height;
  const std::string what = name;
  if (what == "color") to.color = static_cast<float*>(data);
  if (what == "albedo") to.albedo = static_cast<float*>(data);
  if (what == "normal") to.normal = static_cast<float*>(data);
  if (what == "output") to.output = static_cast<float*>(data);
}
void oidnSetFilterBool(void* filter, const char* name, bool value)
{
  if (std::strcmp(name, "hdr") == 0) static_cast<Filter*>(filter)->is_hdr = value;
}
void oidnSetFilterProgressMonitorFunction(void* filter, bool (*goes_on)(void*, double), void* user)
{
  static_cast<Filter*>(filter)->goes_on = goes_on;
  static_cast<Filter*>(filter)->user = user;
}
void oidnCommitFilter(void* filter) { static_cast<Filter*>(filter)->is_committed = true; }
void oidnExecuteFilter(void* filter)
{
  const auto& of = *static_cast<Filter*>(filter);
  if (!of.color || !of.albedo || !of.normal || !of.output || !of.is_hdr || !of.is_committed) {
    g_error = "not all was set";
    return;
  }
  // The real one tells of it by an error of its device, which is let go then.
  if (of.goes_on != nullptr && !of.goes_on(of.user, 0.5)) return;
  for (std::size_t i = 0; i < of.num_pixels; ++i) {
    if (of.albedo[3 * i] > 1) g_error = "the albedo is too bright";
  }
  for (std::size_t i = 0; i < 3 * of.num_pixels; ++i) of.output[i] = 2 * of.color[i];
}
void oidnReleaseFilter(void* filter) { delete static_cast<Filter*>(filter); }
}
