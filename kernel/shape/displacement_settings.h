// How a material displaces its meshes: read by scene/, traced by displacement/.
#pragma once

#include <cstdint>
#include <string_view>

#include "kernel/kernel.h"
#include "kernel/texture/texture_view.h"

namespace relief {

/// How displaced meshes are traced.
enum class DisplacementMethod : std::uint8_t {
  kAuto,  ///< what the scene and the memory ask for
#define X(name, label) name,
#include "kernel/shape/displacement_methods.inc"
#undef X
};

inline constexpr std::string_view kDisplacementMethodLabels[] = {
    "auto",
#define X(name, label) label,
#include "kernel/shape/displacement_methods.inc"
#undef X
};

RELIEF_KERNEL std::string_view displacement_method_label(DisplacementMethod method)
{
  return kDisplacementMethodLabels[static_cast<int>(method)];
}

enum class DisplacementSpace : std::uint8_t { kObject, kWorld };

/// Most cells along a triangle's side, of heights that are computed.
inline constexpr std::int32_t kMostHeightCells = 1 << 19;

struct DisplacementSettings {
  TextureRef height;              ///< its texture index is that of a height map; −1: it has none
  std::int32_t graph_index = -1;  ///< of heights that are computed, into Scene::graphs; −1: they have a map
  std::int32_t num_cells =
      0;  ///< of computed heights along each side of a triangle, a power of two; 0: by their size in the picture
  float cell_pixels =
      1;  ///< how long they are in the picture, with 0 cells; of a map that is diced, in units of the error
  float cell_length = 0;        ///< metres of object space, in place of pixels; 0: none
  float coarser_outside = 4;    ///< how many times as long they may be out of the picture
  std::int32_t most_cells = 0;  ///< along each side of a triangle; 0: any number
  float scale = 1;        ///< metres
  float midlevel = 0.5f;
  DisplacementSpace space = DisplacementSpace::kObject;
  DisplacementMethod method = DisplacementMethod::kAuto;
  float lod = 0;  ///< −1: auto
  bool smoothing = false;
  bool weld_seams = false;
  bool has_graph = false;  ///< heights are those of a value graph
  bool by_vectors = false;  ///< the graph says where points go, metres, object space; `scale` and what follows is in it
  bool divide = false;      ///< vertices of small triangles do not stand for what is between them
  bool curved = false;     ///< the base is a smooth surface through the mesh's vertices with its normals there
};

/// Whether heights are computed where rays ask for them, rather than a map's.
RELIEF_KERNEL bool displacement_is_computed(const DisplacementSettings& settings)
{
  return settings.graph_index >= 0 || settings.curved;
}

}  // namespace relief
