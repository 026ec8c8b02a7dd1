// Reading accessors: every component type, normalized integers, strides, sparse replacement. All bounds are checked once
// per accessor, before anything is allocated; the loops over elements then run unchecked on raw bytes.
#pragma once

#include <cstring>
#include <type_traits>
#include <vector>

#include "scene/gltf_document.h"

namespace relief {

/// An accessor whose bounds have been checked.
struct AccessorView {
  const GltfDocument* document = nullptr;
  int index = -1;
  const std::byte* data = nullptr;  ///< first element; null: all zeros, before sparse values
  std::size_t count = 0;
  std::size_t stride = 0;  ///< bytes
  int component_type = 0;  ///< glTF's number, 5120…5126
  int num_components = 0;
  bool normalized = false;

  std::size_t num_sparse = 0;
  const std::byte* sparse_indices = nullptr;
  int sparse_index_type = 0;
  const std::byte* sparse_values = nullptr;  ///< tightly packed
};

/// Sets of component types, for `accessor_open`.
enum class AccessorKind : std::uint8_t {
  kVertex,             ///< 8- and 16-bit integers, normalized or not (KHR_mesh_quantization), or float
  kIndex,              ///< unsigned, not normalized
  kFloatOrNormalized,  ///< animation data
};

/// Checks an accessor for a use.
/// @param index  valid (validated core)
/// @param min_components, max_components  range of components an element may have (1: SCALAR, 2…4: vectors)
/// @param user_path  JSON path of what uses it, named when the type is wrong for the use
/// @error SceneError: wrong type; data outside the buffer view; stride shorter than an element; sparse indices that are
///        out of range or not increasing; an absurd number of elements without data
AccessorView accessor_open(const GltfDocument& document,
                           int index,
                           AccessorKind kind,
                           int min_components,
                           int max_components,
                           const std::string& user_path);

/// Converts elements [first, first + count) to floats, `num_components` each, into `out`.
/// @param out  room for count · view.num_components floats
/// @error SceneError at /accessors/i for the first NaN or infinity
void accessor_read_floats(const AccessorView& view, std::size_t first, std::size_t count, float* out);

/// Same, as a vector of structs of floats.
/// @pre sizeof(T) == 4 · view.num_components
template <typename T>
std::vector<T> accessor_read(const AccessorView& view, std::size_t first, std::size_t count)
{
  static_assert(std::is_trivially_copyable_v<T> && std::is_standard_layout_v<T> && sizeof(T) % sizeof(float) == 0);
  std::vector<T> out(count);
  if (count > 0) {
    accessor_read_floats(view, first, count, reinterpret_cast<float*>(out.data()));
  }
  return out;
}

template <typename T>
std::vector<T> accessor_read(const AccessorView& view)
{
  return accessor_read<T>(view, 0, view.count);
}

/// Unsigned integers of a scalar accessor.
std::vector<std::uint32_t> accessor_read_indices(const AccessorView& view);

}  // namespace relief
