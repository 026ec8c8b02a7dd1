// A loaded scene: plain immutable data, indices instead of pointers. Made by scene/load.h, read by the integrator
// through views. Everything is in the units of the scene format: metres, Y up, linear Rec.709.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kernel/bsdf/material.h"
#include "kernel/camera/camera.h"
#include "kernel/graph/graph_scene.h"
#include "kernel/light/light.h"
#include "kernel/shape/border_edge.h"
#include "kernel/shape/displacement_settings.h"
#include "kernel/shape/mesh_view.h"
#include "kernel/volume/medium.h"
#include "scene/diagnostics.h"
#include "scene/environment_graph.h"
#include "scene/file_stamp.h"
#include "scene/graph/graph_program.h"
#include "scene/height_map.h"
#include "scene/render_settings.h"
#include "scene/shutter.h"

namespace relief {

class TextureStore;  // scene/texture_store.h

/// A named vertex attribute that value graphs read.
struct AttributeColumn {
  std::uint16_t name = 0;  ///< place in Scene::attribute_names
  int num_components = 0;
  std::vector<float> values;  ///< num_components a vertex
};

/// Values that instances have by one name.
struct InstanceColumn {
  std::uint16_t name = 0;     ///< place in Scene::attribute_names
  std::vector<float> values;  ///< four an instance, see GraphInstanceColumn; those at the end may be missing
};

/// A mesh that deforms, at one time while the shutter is open.
struct MeshStep {
  std::vector<Vec3f> P;
  std::vector<Normal3f> N;  ///< empty if the mesh has none
};

/// One glTF primitive: a triangle mesh, curves or points, with one material.
///
/// Curves are splines of Catmull and Rom through their points; each one's first and last stand twice, so that a segment from vertex
/// i to i + 1 has vertices i - 1 to i + 2. Its "triangle" is i, i + 1, i: by any weights of a hit's, w0 + w2 = 1 - u and w1 = u, so what reads vertices
/// of triangles reads those of segments as it is.
struct Mesh {
  std::string name;
  std::vector<Vec3f> P;
  std::vector<Normal3f> N;     ///< empty: flat shading
  std::vector<Vec2f> uv[2];    ///< empty: absent
  std::vector<Vec4f> tangent;  ///< empty: derived where a normal map needs them
  std::vector<Vec4f> color;
  std::vector<Vec3f> generated;          ///< _GENERATED, see MeshView; empty: absent
  std::vector<AttributeColumn> columns;  ///< what graphs read by name
  std::vector<TriangleIndices> triangles;
  std::vector<float> radius;  ///< of curves and points, metres, a vertex; empty: these are triangles
  bool are_ribbons = false;   ///< of curves: flat and facing the ray, else tubes
  bool are_points = false;    ///< these are balls, one a vertex: the "triangle" of number i is i, i, i
  std::vector<MeshStep> steps;  ///< at the times of Scene::motions; empty: it does not deform
  int material_index = 0;       ///< always valid: the loader adds glTF's default material where none is named
  int copy_of = -1;  ///< mesh of the file that this is under some transform, see world_displacement.h; −1: none

  MeshView view() const;
  std::size_t bytes() const;
};

struct Instance {
  std::string name;   ///< of the node
  std::string asset;  ///< RELIEF_object's, or the name of the topmost node above
  int mesh_index = 0;
  int material_index = 0;
  Affine3 world_from_object;
  std::uint32_t flags = kVisibleToCamera | kCastsShadow;
  int motion_index = -1;  ///< into Scene::motions: places while the shutter is open; −1: it stands still
  int object_index = -1;  ///< the same for all primitives of one node, or of one copy in it; −1: it is alone
};

/// Edges that two meshes of an object have in common, which walls are to close.
struct Border {
  int mesh_index = 0;             ///< one triangle without area for each edge: its ends, and the second once more
  std::vector<BorderEdge> edges;  ///< of the meshes of both sides
};

/// Where a border is.
struct BorderInstance {
  int border_index = 0;
  int sides[2] = {0, 0};  ///< instances; the walls have all that the second one has but its mesh
};

struct SceneCamera {
  std::string name;
  Camera camera;     ///< half_width is for the aspect ratio `aspect`
  float aspect = 0;  ///< width / height that the file asks for; 0: follows the image
  Shutter shutter;
  int motion_index = -1;  ///< as Instance::motion_index
};

/// Lat-long map, graph or constant. See docs/scene_format.md for the orientation.
struct Surroundings {
  Vec3f color{0, 0, 0};                   ///< radiance factor, strength included
  int texture_index = -1;                 ///< into TextureStore; −1: no map
  std::optional<EnvironmentGraph> graph;  ///< in a map's place
  float rotation = 0;      ///< radians about +Y
};

/// What surrounds the scene and lights it.
struct Environment : Surroundings {
  std::optional<Surroundings> backdrop;  ///< what camera rays see in its place
  bool visible_to_camera = true;
  bool casts_caustics = true;     ///< as Light::casts_caustics
  std::uint32_t hidden_from = 0;  ///< bit PathEvent, or kHiddenFromScattered: bounced rays that do not see it
  std::uint32_t light_group = 0;  ///< as Light::light_group
  std::optional<Medium> medium;   ///< that fills all space
  VolumeProgram varying_medium;   ///< see Scene::varying_media
  /// Perceptual: where the camera does not see it, glass up to this roughness is as clear as air. Empty: glass is opaque.
  std::optional<float> clear_roughness;
};

/// One animation of a file; all of them play at once.
struct AnimationClip {
  std::string name;
  double start = 0, end = 0;  ///< seconds: its first and last key
};

struct Scene {
  std::string file;
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  std::vector<Border> borders;
  std::vector<BorderInstance> border_instances;  ///< of the last instances: those before are what the file has
  std::vector<Material> materials;
  std::vector<std::string> material_names;
  std::vector<Medium> media;                 ///< by Material::medium_index
  std::vector<VolumeProgram> varying_media;  ///< likewise: what gives those that vary, which are empty in `media`
  std::vector<GraphProgram> graphs;          ///< by Material::graph_index and so on, and by Lamp::graph_index
  std::vector<std::string> attribute_names;  ///< of attributes that graphs read
  std::vector<InstanceColumn> instance_columns;
  std::vector<std::string> light_groups;  ///< names by Light::light_group − 1
  std::vector<Light> lights;  ///< everything but mesh triangles and the environment
  /// Transforms at evenly spaced times, from when the shutter opens to when it closes; of lights see LightsView::motions. What
  /// stands where it is when the shutter is half done is everywhere else in this scene.
  std::vector<std::vector<Affine3>> motions;
  std::vector<Lamp> lamps;              ///< by Light::lamp_index
  std::vector<std::string> node_names;  ///< of all files, as far as they have names, each once, in file order
  std::vector<AnimationClip> clips;     ///< of all files
  Vec3f bounds_low, bounds_high;        ///< box of all instances, undisplaced, world; low > high without any
  std::vector<SceneCamera> cameras;     ///< never empty: the loader adds a framing camera (and a warning) if need be
  std::vector<DisplacementSettings> displacements;  ///< by Material::displacement_index
  std::vector<HeightMap> height_maps;
  Environment environment;
  RenderSettings render;
  std::shared_ptr<const TextureStore> textures;
  std::vector<std::string> warnings;
  std::vector<FileStamp> files;  ///< everything that was read: the scene, buffers, images, references; as before that

  /// How many instances there are before those of borders.
  std::size_t num_placed() const { return instances.size() - border_instances.size(); }
};

}  // namespace relief
