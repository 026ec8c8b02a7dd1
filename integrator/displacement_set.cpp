#include "integrator/displacement_set.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>
#include <tuple>

#include "integrator/stages.h"

namespace relief {

namespace {

/// Mean scale of a transform: the cube root of its determinant.
double mean_scale(const Affine3& m) { return std::cbrt(std::abs(static_cast<double>(dot(m.x, cross(m.y, m.z))))); }

TraversalMethod method_of(const DisplacementSettings& settings, const DisplacementOptions& options)
{
  if (options.method) return *options.method;
  switch (settings.method) {
    case DisplacementMethod::kRmip:
      return TraversalMethod::kRmip;
    case DisplacementMethod::kMinmaxRmip:
      return TraversalMethod::kRmipOnMinmax;
    case DisplacementMethod::kTfdm:
      return TraversalMethod::kTfdm;
    default:
      return TraversalMethod::kChord;
  }
}

}  // namespace

DisplacementSet::DisplacementSet(const Scene& scene, const DisplacementOptions& options)
    : geometry_of_instance_(scene.instances.size(), -1), fields_(scene.height_maps.size())
{
  std::map<std::tuple<int, int, double>, int> known;  // mesh, displacement, scale in object space
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const Material& material = scene.materials[static_cast<std::size_t>(instance.material_index)];
    if (material.displacement_index < 0) continue;
    const DisplacementSettings& settings = scene.displacements[static_cast<std::size_t>(material.displacement_index)];
    double scale = settings.scale;
    if (settings.space == DisplacementSpace::kWorld) scale /= mean_scale(instance.world_from_object);
    const auto [at, is_new] = known.try_emplace({instance.mesh_index, material.displacement_index, scale},
                                                static_cast<int>(geometries_.size()));
    geometry_of_instance_[i] = at->second;
    if (!is_new) continue;
    auto& field = fields_[static_cast<std::size_t>(settings.height.texture_index)];
    if (field == nullptr) {
      field = std::make_unique<HeightField>(
          scene.height_maps[static_cast<std::size_t>(settings.height.texture_index)].view());
    }
    auto displaced = std::make_unique<Displaced>();
    displaced->mesh = DisplacedMesh(scene.meshes[static_cast<std::size_t>(instance.mesh_index)].view(), field->view(),
                                    {settings.height, scale, settings.midlevel});
    displaced->geometry.mesh = displaced->mesh.view();
    displaced->geometry.method = method_of(settings, options);
    geometries_.push_back(std::move(displaced));
  }
}

std::size_t DisplacementSet::bytes() const
{
  std::size_t sum = 0;
  for (const auto& field : fields_) sum += field != nullptr ? field->bytes() : 0;
  for (const auto& displaced : geometries_) sum += displaced->mesh.bytes();
  return sum;
}

std::uint64_t DisplacementSet::num_triangles() const
{
  std::uint64_t sum = 0;
  for (const auto& displaced : geometries_) sum += displaced->geometry.mesh.num_triangles;
  return sum;
}

const TraversalTable& traversal_table_select()
{
  return std::string_view(stage_table_select().isa) == "avx2" ? traversal_table_avx2() : traversal_table_baseline();
}

}  // namespace relief
