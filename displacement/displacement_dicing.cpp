#include "displacement/displacement_set.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include "displacement/cost_model.h"
#include "displacement/displacement_choice.h"

namespace relief {

namespace {

/// Of meshes diced to a pixel, facets included: benchmarks/cycles' sphere and torus took .34 of what they take by chord. Of a
/// texture's every texel, tessellations are larger than caches, and cost more (methods/tessellate.cpp).
constexpr MethodCost kDicingCost{208, 29, 110};

/// From so many rays a micro-triangle on quadrilaterals, in which rays take some 60 ns less, repay what building them takes longer than
/// blocks: 240 ns, and three and a half times the memory.
constexpr double kRaysThatRepayQuads = 4;

/// What rays take exactly where such a mesh covers the picture: 0.5 to 2.1 µs more than diced over seven scenes of
/// benchmarks/displacement/first_pixel.py, 1.0 in the mean. (Rays of the bench, from one surface alone, take 930 ns in all.)
constexpr MethodCost kExactCost{1250, 0, 0};

/// A mesh's own triangles take this besides: sides are brought together, and corners. Two million took .8 s more than their
/// micro-triangles.
constexpr double kOwnTriangleSeconds = 4e-7;

/// Refuses what would not fit, before anything large is allocated.
/// @param bytes  all tessellations so far, this one included
void check_budget(std::uint64_t bytes,
                  const TessellationLayout& layout,
                  const std::string& mesh,
                  const DisplacementOptions& options)
{
  const std::uint64_t budget = options.tessellation_bytes > 0 ? options.tessellation_bytes : memory_of_machine() / 2;
  if (bytes <= budget) return;
  throw std::runtime_error(
      "tessellating mesh '" + mesh + "' into " + std::to_string(layout.num_micro_triangles / 1'000'000) +
      " million triangles would take about " + gibibytes(bytes) + ", more than the " + gibibytes(budget) +
      " that tessellations may have; the other displacement methods do not tessellate");
}

/// For a mesh that is tessellated: such are not kept.
void forget_tree(PreparedMesh& mesh)
{
  mesh.content.reset();
  mesh.tree.reset();
  mesh.geometry.scene = nullptr;
}

}  // namespace

void DisplacementSet::set_facets(const Use& use, DisplacedGeometry* geometry, bool diced) const
{
  const int last = geometry->first_level + geometry->lod.num_levels - 1;
  if (last == 0) return;
  MapFacets& facets = geometry->facets.emplace(MapFacets{height_lattice_make(map_of(use).view)});
  const bool tessellated = displacement_method(geometry->method).tessellation.has_value();
  const double spacing = diced ? Dicing::kTexelsASide : tessellated ? 1.0 : 0.0;
  facets.window = diced ? 1.0 / Dicing::kTexelsASide : 1.0;
  for (int level = std::max(geometry->first_level, 1); level <= last; ++level) {
    // What is diced to a level has the heights of the one before.
    static_assert(Dicing::kTexelsASide == 2);
    const HeightFieldView& heights = *geometry->levels[level - geometry->first_level - (diced ? 1 : 0)].field;
    facets.spread[level] =
        facet_spread(facets.texels, heights, spacing, facets.window * (1 << level), geometry->smooth);
  }
}

void DisplacementSet::tessellate(PreparedMesh& displaced,
                                 const DisplacementOptions& options,
                                 bool is_auto,
                                 double num_rays,
                                 std::uint64_t* used_bytes)
{
  const DisplacedMeshView& mesh = displaced.geometry.mesh;
  const auto layout_of = [&](DisplacementMethod method) {
    return tessellation_layout_make(mesh, *displacement_method(method).tessellation, options.tessellation_rate);
  };
  if (displacement_method(displaced.method).tessellation) {
    TessellationLayout layout = layout_of(displaced.method);
    *used_bytes += tessellation_peak_bytes(layout, kRenderTessellation);
    check_budget(*used_bytes, layout, displaced.name, options);
    displaced.tessellation = std::make_unique<Tessellation>(mesh, std::move(layout));
    forget_tree(displaced);
    return;
  }
  // Layouts cost time and memory of their own, so nothing is made of them without an allowance.
  if (!is_auto || options.auto_bytes <= *used_bytes || displaced.geometry.lod.fixed > 0) return;
  const std::uint64_t allowance = options.auto_bytes - *used_bytes;
  const double seconds = method_seconds(*displacement_method(displaced.method).cost, 0, num_rays);
  std::vector<MethodOffer> offers;
  std::vector<TessellationLayout> layouts;
  for (const DisplacementMethod method : kDisplacementMethods) {
    const DisplacementMethodEntry& entry = displacement_method(method);
    if (!entry.cost) continue;
    offers.push_back({method, *entry.cost, 0, 0});
    layouts.emplace_back();
    if (!entry.tessellation) continue;
    const auto offer = [&](const TessellationLayout& layout) {
      offers.back().num_micro_triangles = layout.num_micro_triangles;
      offers.back().bytes = tessellation_peak_bytes(layout, kRenderTessellation);
    };
    // What cannot win as it is at least is not laid out, which takes longer than tracing a small picture of a mesh of millions.
    offer(tessellation_layout_least(mesh, *entry.tessellation, options.tessellation_rate));
    if (offers.back().bytes > allowance ||
        method_seconds(*entry.cost, offers.back().num_micro_triangles, num_rays) >= seconds) {
      continue;
    }
    layouts.back() = layout_of(method);
    offer(layouts.back());
  }
  const DisplacementChoice choice = displacement_choose(offers, num_rays, allowance);
  reasons_.push_back("mesh '" + displaced.name + "': " + choice.reason);
  if (choice.method == displaced.method) return;
  displaced.method = choice.method;
  const auto chosen =
      std::find_if(offers.begin(), offers.end(), [&](const MethodOffer& o) { return o.method == choice.method; });
  *used_bytes += chosen->bytes;
  displaced.tessellation =
      std::make_unique<Tessellation>(mesh, std::move(layouts[static_cast<std::size_t>(chosen - offers.begin())]));
  forget_tree(displaced);
}

void DisplacementSet::dice(PreparedMesh& displaced,
                           const Use& use,
                           const DisplacementOptions& options,
                           double num_rays,
                           std::uint64_t* used_bytes)
{
  std::uint64_t allowance = dicing_allowance(options);
  const double error = options.error * static_cast<double>(use.settings.cell_pixels);
  bool* is_diced = nullptr;  // of the pictures before and after
  if (options.choices != nullptr) {
    const auto [known, is_new] =
        options.choices->is_diced.try_emplace({use.mesh_name, use.displacement_index, use.mesh.num_triangles, use.scale,
                                               error, options.num_rays, options.picture_height, allowance},
                                              false);
    if (!is_new && !known->second) {
      reasons_.push_back("mesh '" + displaced.name + "': not diced, as it was not in a picture before");
      return;
    }
    is_diced = &known->second;
    // In the first picture with room for what the others may take more.
    if (is_new) allowance /= 2;
  }
  const bool was_diced = is_diced != nullptr && *is_diced;
  allowance -= std::min(allowance, *used_bytes);
  if (Dicing::least_bytes(use.mesh) > allowance) {
    if (is_diced != nullptr) *is_diced = false;
    reasons_.push_back("mesh '" + displaced.name + "': not diced, as its triangles alone are too many for that");
    return;
  }
  DisplacedGeometry& geometry = displaced.geometry;
  // However it is diced, a mesh has the triangles that it has. Of one with millions counting the others takes longer than tracing
  // it for a small picture.
  const double seconds = method_seconds(kExactCost, 0, num_rays);
  const double diced_seconds =
      method_seconds(kDicingCost, use.mesh.num_triangles, num_rays) + kOwnTriangleSeconds * use.mesh.num_triangles;
  if (diced_seconds >= seconds && !was_diced) {
    if (is_diced != nullptr) *is_diced = false;
    char text[96];
    std::snprintf(text, sizeof text, "%.2g s by %s against %.2g s or more by tessellate", seconds,
                  displacement_method_label(geometry.method).data(), diced_seconds);
    reasons_.push_back("mesh '" + displaced.name + "': " + text);
    return;
  }
  const HeightFields::Map& map = map_of(use);
  std::vector<const HeightFieldView*> levels;
  std::vector<int> new_levels;
  for (int k = 0; k < num_useful_levels(use); ++k) {
    if (!fields_->has(map, k)) new_levels.push_back(k);
    levels.push_back(&fields_->field(map, k).bounds.view());
  }
  const MapDensity density = map_density(use.mesh, use.settings.height);
  const double texel = 1 / std::sqrt(std::max(density.u * map.view.width * density.v * map.view.height, 1e-300));
  auto dicing = std::make_unique<Dicing>(use.mesh, geometry.mesh, levels, texel, picture_view(use, options), use.places,
                                         error, options.require);
  const TessellationRule rule = dicing->rule();
  TessellationLayout layout = tessellation_layout_make(dicing->mesh(), TessellationKind::kBlocks, rule);
  if (num_rays > kRaysThatRepayQuads * static_cast<double>(layout.num_micro_triangles)) {
    TessellationLayout quads = tessellation_layout_as(TessellationKind::kQuads, layout);
    if (tessellation_peak_bytes(quads, kRenderTessellation) + dicing->bytes() <= allowance) layout = std::move(quads);
  }
  const std::uint64_t bytes = tessellation_peak_bytes(layout, kRenderTessellation) + dicing->bytes();
  const MethodOffer offers[] = {
      {geometry.method, kExactCost, 0, 0},
      {DisplacementMethod::tessellate, kDicingCost, layout.num_micro_triangles, bytes,
       kOwnTriangleSeconds * dicing->mesh().num_triangles},
  };
  DisplacementChoice choice = displacement_choose(offers, num_rays, allowance);
  if (was_diced && bytes <= allowance)
    choice = {DisplacementMethod::tessellate, choice.reason + "; diced as in a picture before"};
  if (is_diced != nullptr) *is_diced = choice.method != displaced.method;
  reasons_.push_back("mesh '" + displaced.name + "': " + choice.reason);
  if (choice.method == displaced.method) {
    for (const int k : new_levels) fields_->drop(map, k);
    return;
  }
  *used_bytes += bytes;
  displaced.method = choice.method;
  for (std::size_t k = 0; k < levels.size(); ++k) geometry.levels[k] = {levels[k], nullptr};
  geometry.lod = {static_cast<int>(levels.size()), false, 0, geometry.lod.texel};
  set_facets(use, &geometry, true);
  has_facets_ |= geometry.facets.has_value();
  displaced.tessellation = std::make_unique<Tessellation>(dicing->mesh(), std::move(layout), rule);
  displaced.dicing = std::move(dicing);
  forget_tree(displaced);
}

}  // namespace relief
