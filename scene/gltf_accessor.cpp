#include "scene/gltf_accessor.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace relief {
namespace {

constexpr int kByte = 5120, kUnsignedByte = 5121, kShort = 5122, kUnsignedShort = 5123, kUnsignedInt = 5125,
              kFloat = 5126;

std::size_t component_bytes(int type)
{
  switch (type) {
    case kByte:
    case kUnsignedByte:
      return 1;
    case kShort:
    case kUnsignedShort:
      return 2;
    default:
      return 4;
  }
}

const char* component_name(int type)
{
  switch (type) {
    case kByte:
      return "BYTE";
    case kUnsignedByte:
      return "UNSIGNED_BYTE";
    case kShort:
      return "SHORT";
    case kUnsignedShort:
      return "UNSIGNED_SHORT";
    case kUnsignedInt:
      return "UNSIGNED_INT";
    default:
      return "FLOAT";
  }
}

/// Components of an element; 0 for matrices, which nothing here reads.
int type_components(int type)
{
  switch (type) {
    case TINYGLTF_TYPE_SCALAR:
      return 1;
    case TINYGLTF_TYPE_VEC2:
      return 2;
    case TINYGLTF_TYPE_VEC3:
      return 3;
    case TINYGLTF_TYPE_VEC4:
      return 4;
    default:
      return 0;
  }
}

std::string element_name(int num_components)
{
  if (num_components == 0) {
    return "a matrix";
  }
  return num_components == 1 ? "SCALAR" : "VEC" + std::to_string(num_components);
}

bool allows(AccessorKind kind, int component_type, bool normalized)
{
  const bool is_unsigned =
      component_type == kUnsignedByte || component_type == kUnsignedShort || component_type == kUnsignedInt;
  switch (kind) {
    case AccessorKind::kIndex:
      return is_unsigned && !normalized;
    case AccessorKind::kVertex:
      return component_type != kUnsignedInt;
    default:
      return component_type == kFloat || (normalized && component_type != kUnsignedInt);
  }
}

const char* allowed_types(AccessorKind kind)
{
  switch (kind) {
    case AccessorKind::kIndex:
      return "unsigned integers that are not normalized";
    case AccessorKind::kVertex:
      return "FLOAT or 8- or 16-bit integers";
    default:
      return "FLOAT or normalized integers";
  }
}

template <typename T>
T load(const std::byte* p)
{
  T value;
  std::memcpy(&value, p, sizeof(T));
  return value;
}

std::uint32_t load_index(const std::byte* p, int type)
{
  switch (type) {
    case kUnsignedByte:
      return load<std::uint8_t>(p);
    case kUnsignedShort:
      return load<std::uint16_t>(p);
    default:
      return load<std::uint32_t>(p);
  }
}

/// Room for `count` elements of `bytes` each, `stride` apart, from `offset` on.
/// @return pointer to the first
const std::byte* check_range(const GltfDocument& document,
                             int view_index,
                             std::size_t offset,
                             std::size_t count,
                             std::size_t stride,
                             std::size_t bytes,
                             const std::string& path)
{
  const std::span<const std::byte> view = gltf_buffer_view(document, view_index);
  // Written without a product that could overflow: count ≤ 1 + (room − bytes) / stride.
  const bool fits =
      offset <= view.size() && bytes <= view.size() - offset && count - 1 <= (view.size() - offset - bytes) / stride;
  if (!fits) {
    throw SceneError(
        document.file, path,
        "elements within the " + std::to_string(view.size()) + " bytes of /bufferViews/" + std::to_string(view_index),
        std::to_string(count) + " elements of " + std::to_string(bytes) + " bytes, " + std::to_string(stride) +
            " apart, from byte " + std::to_string(offset));
  }
  return view.data() + offset;
}

void open_sparse(AccessorView& view, const tinygltf::Accessor& accessor, const std::string& path)
{
  const GltfDocument& document = *view.document;
  const auto& sparse = accessor.sparse;
  const std::string sparse_path = path + "/sparse";
  view.num_sparse = static_cast<std::size_t>(sparse.count);
  if (view.num_sparse > view.count) {
    throw SceneError(document.file, sparse_path + "/count", "at most the accessor's " + std::to_string(view.count),
                     std::to_string(view.num_sparse));
  }
  view.sparse_index_type = sparse.indices.componentType;
  if (!allows(AccessorKind::kIndex, view.sparse_index_type, false)) {
    throw SceneError(document.file, sparse_path + "/indices/componentType", "5121, 5123 or 5125",
                     std::to_string(view.sparse_index_type));
  }
  const std::size_t index_bytes = component_bytes(view.sparse_index_type);
  const std::size_t element_bytes =
      component_bytes(view.component_type) * static_cast<std::size_t>(view.num_components);
  view.sparse_indices =
      check_range(document, sparse.indices.bufferView, static_cast<std::size_t>(sparse.indices.byteOffset),
                  view.num_sparse, index_bytes, index_bytes, sparse_path + "/indices");
  view.sparse_values =
      check_range(document, sparse.values.bufferView, static_cast<std::size_t>(sparse.values.byteOffset),
                  view.num_sparse, element_bytes, element_bytes, sparse_path + "/values");
  std::int64_t previous = -1;
  for (std::size_t i = 0; i < view.num_sparse; ++i) {
    const std::int64_t at = load_index(view.sparse_indices + i * index_bytes, view.sparse_index_type);
    if (at <= previous || at >= static_cast<std::int64_t>(view.count)) {
      throw SceneError(document.file, sparse_path + "/indices",
                       "increasing indices below " + std::to_string(view.count),
                       std::to_string(at) + " at position " + std::to_string(i));
    }
    previous = at;
  }
}

/// Value of a normalized integer: c / max, signed ones clamped at −1 (glTF 2.0, section 3.6.2.2).
template <typename T>
float convert(const std::byte* p, bool normalized)
{
  const auto value = static_cast<float>(load<T>(p));
  if constexpr (std::is_floating_point_v<T>) {
    return value;
  } else {
    constexpr auto kLargest = static_cast<float>(std::numeric_limits<T>::max());
    return normalized ? std::max(value / kLargest, -1.0f) : value;
  }
}

template <typename T>
void convert_elements(const AccessorView& view,
                      const std::byte* data,
                      std::size_t stride,
                      std::size_t count,
                      float* out)
{
  const auto n = static_cast<std::size_t>(view.num_components);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t c = 0; c < n; ++c) {
      out[i * n + c] = convert<T>(data + i * stride + c * sizeof(T), view.normalized);
    }
  }
}

void convert_any(const AccessorView& view, const std::byte* data, std::size_t stride, std::size_t count, float* out)
{
  const std::size_t element_bytes =
      component_bytes(view.component_type) * static_cast<std::size_t>(view.num_components);
  switch (view.component_type) {
    case kByte:
      convert_elements<std::int8_t>(view, data, stride, count, out);
      break;
    case kUnsignedByte:
      convert_elements<std::uint8_t>(view, data, stride, count, out);
      break;
    case kShort:
      convert_elements<std::int16_t>(view, data, stride, count, out);
      break;
    case kUnsignedShort:
      convert_elements<std::uint16_t>(view, data, stride, count, out);
      break;
    default:
      if (stride == element_bytes) {
        std::memcpy(out, data, count * element_bytes);
      } else {
        convert_elements<float>(view, data, stride, count, out);
      }
      break;
  }
}

/// Position of the first NaN or infinity, or `count`. x − x is 0 for finite x and NaN for the others; the sum of many
/// such terms is tested once a block, so that the loop over good data is one addition a number.
std::size_t first_non_finite(const float* values, std::size_t count)
{
  constexpr std::size_t kBlock = 4096;
  for (std::size_t begin = 0; begin < count; begin += kBlock) {
    const std::size_t end = std::min(begin + kBlock, count);
    float sum = 0;
    for (std::size_t i = begin; i < end; ++i) {
      sum += values[i] - values[i];
    }
    if (!(sum == 0.0f)) {
      return static_cast<std::size_t>(
          std::find_if(values + begin, values + end, [](float x) { return !std::isfinite(x); }) - values);
    }
  }
  return count;
}

}  // namespace

AccessorView accessor_open(const GltfDocument& document,
                           int index,
                           AccessorKind kind,
                           int min_components,
                           int max_components,
                           const std::string& user_path)
{
  const tinygltf::Accessor& accessor = document.core.accessors[static_cast<std::size_t>(index)];
  const std::string path = "/accessors/" + std::to_string(index);
  AccessorView view;
  view.document = &document;
  view.index = index;
  view.count = accessor.count;
  view.component_type = accessor.componentType;
  view.num_components = type_components(accessor.type);
  view.normalized = accessor.normalized;
  if (view.num_components < min_components || view.num_components > max_components) {
    throw SceneError(document.file, user_path,
                     min_components == max_components
                         ? "an accessor of " + element_name(min_components)
                         : "an accessor of " + element_name(min_components) + " to " + element_name(max_components),
                     element_name(view.num_components) + " (" + path + ')');
  }
  if (!allows(kind, view.component_type, view.normalized)) {
    throw SceneError(
        document.file, user_path, std::string("an accessor of ") + allowed_types(kind),
        std::string(view.normalized ? "normalized " : "") + component_name(view.component_type) + " (" + path + ')');
  }
  const std::size_t element_bytes =
      component_bytes(view.component_type) * static_cast<std::size_t>(view.num_components);
  view.stride = element_bytes;
  if (accessor.bufferView < 0) {
    // Without data nothing but this bounds what a few bytes of JSON can make us allocate.
    constexpr std::size_t kMostZeros = 1 << 16;
    if (view.count > kMostZeros) {
      throw SceneError(document.file, path + "/count",
                       "at most " + std::to_string(kMostZeros) + " elements without a bufferView",
                       std::to_string(view.count));
    }
  } else {
    const std::size_t stride = document.core.bufferViews[static_cast<std::size_t>(accessor.bufferView)].byteStride;
    if (stride != 0) {
      if (stride < element_bytes) {
        throw SceneError(document.file, "/bufferViews/" + std::to_string(accessor.bufferView) + "/byteStride",
                         "at least the " + std::to_string(element_bytes) + " bytes of an element of " + path,
                         std::to_string(stride));
      }
      view.stride = stride;
    }
    view.data =
        check_range(document, accessor.bufferView, accessor.byteOffset, view.count, view.stride, element_bytes, path);
  }
  if (accessor.sparse.isSparse) {
    open_sparse(view, accessor, path);
  }
  return view;
}

void accessor_read_floats(const AccessorView& view, std::size_t first, std::size_t count, float* out)
{
  const auto n = static_cast<std::size_t>(view.num_components);
  if (view.data != nullptr) {
    convert_any(view, view.data + first * view.stride, view.stride, count, out);
  } else {
    std::fill(out, out + count * n, 0.0f);
  }
  const std::size_t index_bytes = component_bytes(view.sparse_index_type);
  const std::size_t value_bytes = component_bytes(view.component_type) * n;
  for (std::size_t i = 0; i < view.num_sparse; ++i) {
    const std::size_t at = load_index(view.sparse_indices + i * index_bytes, view.sparse_index_type);
    if (at >= first && at < first + count) {
      convert_any(view, view.sparse_values + i * value_bytes, value_bytes, 1, out + (at - first) * n);
    }
  }
  const std::size_t bad = first_non_finite(out, count * n);
  if (bad < count * n) {
    throw SceneError(
        view.document->file, "/accessors/" + std::to_string(view.index), "finite numbers",
        std::string(std::isnan(out[bad]) ? "NaN" : "infinity") + " in element " + std::to_string(first + bad / n));
  }
}

std::vector<std::uint32_t> accessor_read_indices(const AccessorView& view)
{
  std::vector<std::uint32_t> out(view.count);
  if (view.data != nullptr) {
    if (view.component_type == kUnsignedInt && view.stride == 4) {
      std::memcpy(out.data(), view.data, view.count * 4);
    } else {
      for (std::size_t i = 0; i < view.count; ++i) {
        out[i] = load_index(view.data + i * view.stride, view.component_type);
      }
    }
  }
  const std::size_t index_bytes = component_bytes(view.sparse_index_type);
  const std::size_t value_bytes = component_bytes(view.component_type);
  for (std::size_t i = 0; i < view.num_sparse; ++i) {
    out[load_index(view.sparse_indices + i * index_bytes, view.sparse_index_type)] =
        load_index(view.sparse_values + i * value_bytes, view.component_type);
  }
  return out;
}

}  // namespace relief
