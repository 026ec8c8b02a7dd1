// What displaced materials need to be traced: height fields shared by meshes, and one displaced geometry for each mesh
// and displacement that occur together.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "displacement/border_strips.h"
#include "displacement/height_fields.h"
#include "displacement/lattice_split.h"
#include "displacement/level_facets.h"
#include "displacement/moved_mesh.h"
#include "displacement/picture_view.h"
#include "displacement/prepared_mesh.h"
#include "displacement/seams.h"
#include "kernel/camera/camera.h"

namespace relief {

/// A mesh in the world.
struct DisplacedInstance {
  int mesh_index = 0;
  int displacement_index = -1;  ///< −1: not displaced
  int heights_index = -1;       ///< of heights that are computed; −1: the displacement has a map
  Affine3 world_from_object;
};

/// Heights of a mesh that are computed where they are wanted.
struct ComputedHeights {
  HeightSource source;         ///< without eval: the displacement's map is, if it has one
  CornerHeights corners = {};  ///< by `source`
  PointMoves moves = {};       ///< in place of both, where the displacement is by vectors
  CellsAlong cells;            ///< that are wanted; not used with num_cells
  CellsAlong cells_seen = {};  ///< likewise, fewer where the camera does not look
  std::int32_t num_cells = 0;  ///< along each side of all triangles, a power of two; 0: by `cells`
  bool is_constant = false;    ///< the same all over the mesh
};

/// An instance that stands for the walls between two others.
struct DisplacedBorder {
  std::size_t instance = 0, sides[2] = {0, 0};
  std::span<const BorderEdge> edges;  ///< of the sides' meshes; its own has a triangle for each, see border_strips_make
};

/// What there is to be displaced.
struct DisplacementInput {
  std::vector<MeshView> meshes;
  std::vector<std::string> mesh_names;
  /// By mesh, at evenly spaced times while the shutter is open; the meshes are as when that is half done. What they point to must
  /// outlive the set. Empty, or none of a mesh: it does not deform.
  std::vector<std::vector<MeshShape>> mesh_steps;
  std::vector<HeightFields::Map> height_maps;  ///< their texels must outlive the set
  std::span<const DisplacementSettings> settings;
  std::vector<DisplacedInstance> instances;
  std::vector<DisplacedBorder> borders;
  std::vector<ComputedHeights> heights;
  std::shared_ptr<const void> heights_owner;  ///< of what their sources read
};

/// Whose vertices displacement moves.
enum class VertexMove : std::uint8_t {
  kNone,       ///< rays are traced over the heights, or tiles of points
  kOwn,        ///< the mesh's
  kHalved,     ///< likewise, and the middles of its triangles' sides
  kQuartered,  ///< likewise, and the middles of the halves
  kDivided     ///< those of triangles that its own are divided to
};

/// Which meshes of a sequence of pictures are diced or moved, decided where they are met first. What dicing takes and spares changes
/// with the camera: decided anew, a mesh would be exact in one picture and diced in the next, and its mean would jump.
struct DicingChoices {
  /// A mesh by its name, displacement and triangles, and what dicing is asked for.
  struct Key {
    std::string mesh;
    int displacement_index;
    std::uint32_t num_triangles;
    double scale, error, num_rays;
    int picture_height;
    std::uint64_t allowance_bytes;
    auto operator<=>(const Key&) const = default;
  };
  std::map<Key, bool> is_diced;
  std::map<Key, VertexMove> moved;  ///< likewise, which ones have their vertices moved
};

/// What overrides the settings.
struct DisplacementOptions {
  std::optional<DisplacementMethod> method;  ///< of all materials
  std::optional<float> lod;                  ///< of all height maps, see DisplacementSettings::lod
  std::optional<RmipOptions> rmip;           ///< of the methods that take them
  double tessellation_rate = 1;              ///< micro-triangle edges a texel
  double error = 0;              ///< pixels that detail of maps may be wide and missing, with a camera; 0: none
  std::uint64_t auto_bytes = 0;  ///< what `auto` may use while it builds tessellations; 0: it builds none
  std::optional<Camera> camera;  ///< by which computed heights choose their cells; empty: the scene's first
  int picture_height = 0;        ///< pixels, with a camera
  double num_rays = 0;           ///< that will be traced, about, for `auto` to weigh building against tracing
  std::uint64_t computed_bytes = std::uint64_t{256} << 20;  ///< computed heights that are kept, at most
  std::shared_ptr<HeightFields> fields;                     ///< of the sets before; null: each set has its own
  std::shared_ptr<KeptMeshes> meshes;                       ///< likewise, with the same fields; null: none are kept
  std::shared_ptr<DicingChoices> choices;                   ///< of the sets before; null: this is the only one
  RequireBytes require;            ///< asked before and while much is allocated; null: nobody is
  std::uint64_t dicing_bytes = 0;  ///< what dicing may use if auto_bytes says nothing; 0: an eighth of the machine's
  std::uint64_t tessellation_bytes = 0;  ///< all tessellations may take while they are built; 0: half of the machine's
};

/// How tessellations of a render are built.
inline constexpr TessellationBuild kRenderTessellation{RTC_BUILD_QUALITY_MEDIUM, false};

/// What of some settings is not followed as it is written: what is done instead, a line each.
std::vector<std::string> displacement_warnings(const DisplacementSettings& settings,
                                               const DisplacementOptions& options);

class DisplacementSet {
 public:
  /// @error std::runtime_error with the estimate if tessellations would need more memory than they may
  DisplacementSet(const DisplacementInput& input, const DisplacementOptions& options);
  /// Leaves to the sets after what they may use.
  ~DisplacementSet();
  DisplacementSet(DisplacementSet&&) = default;
  DisplacementSet& operator=(DisplacementSet&&) = delete;

  /// @return  index of the displaced geometry of an instance; −1: it is not displaced, or its mesh is moved
  int geometry_index(std::size_t instance) const { return geometry_of_instance_[instance]; }
  /// @return  index of the moved mesh that an instance has in place of its own; −1: it has its own
  int moved_index(std::size_t instance) const { return moved_of_instance_[instance]; }
  /// Those that stand for a mesh of the input, then strips that stand for borders.
  std::span<const MovedMesh> moved() const { return moved_; }
  std::size_t size() const { return geometries_.size(); }
  /// Whether rays must say what detail they ask for.
  bool has_levels() const { return has_levels_; }
  /// Whether rays may meet texels that are coarser than their map's.
  bool has_facets() const { return has_facets_; }
  /// Widths of finest texels by instance, metres, world; 0 where it is not displaced.
  const float* texels() const { return texel_of_instance_.data(); }
  DisplacedGeometry& geometry(std::size_t index) { return geometries_[index]->geometry; }
  /// A geometry's tree, committed; null: there is none yet.
  const std::shared_ptr<RTCSceneTy>& tree(std::size_t index) const { return geometries_[index]->tree; }
  /// @param seconds  that building it took
  void set_tree(std::size_t index, std::shared_ptr<RTCSceneTy> tree, std::uint64_t bytes, double seconds);
  const DisplacedMesh& mesh(std::size_t index) const { return geometries_[index]->mesh; }
  Box3 bounds(std::size_t index) const;  ///< of a geometry, object space
  /// @return null if the geometry is traversed as it is
  const Tessellation* tessellation(std::size_t index) const { return geometries_[index]->tessellation.get(); }
  /// Completes a hit on a displaced instance.
  /// @param placement  the instance's
  /// @param primitive  as Embree reports it, like the record
  DisplacedPoint resolve(std::size_t instance,
                         const InstanceView& placement,
                         std::uint32_t primitive,
                         EmbreeHitRecord record) const;
  /// The facets around a hit on a level.
  /// @param jitter  as in level_facets_make, like the result
  bool facets(std::size_t instance, const LevelPlace& at, Vec2f jitter, LevelFacets* out) const
  {
    return level_facets_make(displaced(instance).geometry, at, jitter, out);
  }
  /// The base triangle and weights of a hit alone.
  DisplacedPoint locate(std::size_t instance, std::uint32_t primitive, EmbreeHitRecord record) const;
  /// Place of a displaced geometry's settings in the input.
  int displacement_index(std::size_t index) const { return geometries_[index]->displacement_index; }
  /// The texture seams of a displaced geometry's mesh.
  SeamReport seams(std::size_t index) const;
  std::size_t bytes() const;  ///< besides the maps
  /// Tiles of points that rays asked for: how often one was made, how often that took the room of another, and what they take.
  struct TileTally {
    std::uint64_t made = 0, evicted = 0, bytes = 0;
  };
  TileTally tiles() const;
  std::uint64_t num_triangles() const;                       ///< of all geometries
  DisplacedMeshReport report() const;                        ///< sums over all geometries
  const HeightFields::Tally& kept() const { return kept_; }  ///< of the sets before
  const KeptMeshes::Tally& kept_meshes() const { return kept_tally_; }
  std::string method_names()
      const;  ///< of the geometries, separated by commas, "tiles" and "vertices" for moved meshes
  /// What `auto` chose by, a line a geometry.
  const std::vector<std::string>& reasons() const { return reasons_; }
  /// Parts of the surfaces that are missing, and methods that are not followed.
  std::vector<std::string> warnings() const;

 private:
  /// Moves the origins of rays that leave a point away from walls beside it.
  void leave_walls(const PreparedMesh& d, const InstanceView& placement, DisplacedPoint* point) const;
  const PreparedMesh& displaced(std::size_t instance) const
  {
    return *geometries_[static_cast<std::size_t>(geometry_of_instance_[instance])];
  }
  /// Levels that the rays of a geometry may see, from the map's own or a coarser one on.
  struct Levels {
    int first = 0, count = 1;
    bool by_cone = false;
    float fixed = 0;  ///< above `first`
  };
  /// A mesh and a displacement that occur together, on one or more instances.
  struct Use {
    const MeshView& mesh;
    int mesh_index;
    const std::string& mesh_name;
    int displacement_index;
    const DisplacementSettings& settings;
    const ComputedHeights* heights;    ///< null: a map's
    std::span<const MeshShape> steps;  ///< none: it does not deform
    double scale = 1;                  ///< metres of object space
    std::vector<Affine3> places{};     ///< its instances: the world from its own space
    double steepening = 1;  ///< how much steeper its instances' slopes are in the world than in object space, at most
    bool has_borders = false;  ///< walls end at its surface, which is one then: rays choose no levels by their cones
  };
  static PictureView picture_view(const Use& use, const DisplacementOptions& options);
  static std::vector<double> shares_of(std::span<const Use> uses, const DisplacementOptions& options);
  std::vector<Use> find_uses(const DisplacementInput& input);
  Levels levels_of(const Use& use, const DisplacementOptions& options) const;
  std::unique_ptr<PreparedMesh> make_displaced(const Use& use, const DisplacementOptions& options);
  /// Kept or new, with nothing filled in but its prisms, tree and content.
  /// @param fields  the finest level, then those that rays may see instead
  std::unique_ptr<PreparedMesh> prisms_of(const Use& use,
                                          const DisplacementMapping& mapping,
                                          const std::vector<const HeightFieldView*>& fields);
  std::unique_ptr<PreparedMesh> make_computed(const Use& use, const DisplacementOptions& options);
  std::unique_ptr<PreparedMesh> make_tiled(const Use& use, std::vector<LatticeTriangle> parts);
  /// Whose vertices a use is to move: the mesh's where heights are the same everywhere or triangles a few cells wide, those of
  /// divided ones where they have room. Where they have none, rays are traced over tiles of them; where these have none either, over
  /// the heights.
  /// @param parts       receives those of divided triangles, and of tiles
  /// @param used_bytes  by all meshes so far; grows by what dividing takes
  VertexMove vertex_move_of(const Use& use,
                            const DisplacementOptions& options,
                            std::vector<LatticeTriangle>* parts,
                            std::uint64_t* used_bytes);
  /// The same for a map: those of a dense mesh, or none.
  VertexMove map_move_of(const Use& use, const DisplacementOptions& options, std::uint64_t* used_bytes);
  /// The same for vectors: where even tiles have no room, or the mesh deforms, triangles are larger.
  VertexMove vector_move_of(const Use& use,
                            const DisplacementOptions& options,
                            std::vector<LatticeTriangle>* parts,
                            std::uint64_t* used_bytes);
  /// Whether rays are to be traced over tiles of some parts: because those have no room as a mesh, or their method says so.
  /// @param used_bytes  grows by what that takes, if so
  bool fits_in_tiles(const Use& use,
                     const DisplacementOptions& options,
                     std::span<const LatticeTriangle> parts,
                     std::uint64_t allowance,
                     std::uint64_t* used_bytes);
  MovedMesh make_moved(const Use& use, VertexMove move, std::span<const LatticeTriangle> parts);
  using PartsOfMoved = std::vector<std::vector<LatticeTriangle>>;  ///< of divided meshes with borders
  void make_borders(const DisplacementInput& input, const PartsOfMoved& parts);
  /// An instance's side of a border.
  BorderSide border_side(const DisplacementInput& input, std::size_t instance, const PartsOfMoved& parts) const;
  /// Levels of a map that still show something on a mesh.
  int num_useful_levels(const Use& use) const;
  /// The method that a use is to be traced by; `auto` may still tessellate.
  DisplacementMethod method_of(const Use& use, const DisplacementOptions& options) const;
  void leave_untessellated(const Use& use, const DisplacementOptions& options);
  /// Whether a use is to be traced to an error, not exactly nor as its settings say.
  bool has_error(const Use& use, const DisplacementOptions& options) const;
  /// Fills in what the levels of a geometry have lost.
  /// @param diced  it is, see dicing.h
  void set_facets(const Use& use, DisplacedGeometry* geometry, bool diced) const;
  /// Tessellates a mesh as finely as the picture shows it, if that pays.
  void dice(PreparedMesh& displaced,
            const Use& use,
            const DisplacementOptions& options,
            double num_rays,
            std::uint64_t* used_bytes);
  /// How many levels of a map, the finest first, look like the map on a mesh and all its instances: what they lose of its
  /// slopes and heights is little.
  int num_faithful_levels(const Use& use, int most);
  /// Tessellates where the method, or `auto`, wants it.
  /// @param used_bytes  by all tessellations so far; grows
  void tessellate(PreparedMesh& displaced,
                  const DisplacementOptions& options,
                  bool is_auto,
                  double num_rays,
                  std::uint64_t* used_bytes);
  const HeightFields::Map& map_of(const Use& use) const
  {
    return height_maps_[static_cast<std::size_t>(use.settings.height.texture_index)];
  }

  std::vector<HeightFields::Map> height_maps_;
  std::vector<MeshView> meshes_;
  std::shared_ptr<const void> heights_owner_;
  std::unique_ptr<LatticeCache> lattice_cache_;  ///< of computed heights; null: there are none
  std::unique_ptr<PointTileCache> tile_cache_;   ///< of points that move, likewise
  std::uint64_t num_tiles_ = 0;                  ///< of all geometries
  std::vector<int> geometry_of_instance_, moved_of_instance_;
  std::vector<float> texel_of_instance_;
  bool has_levels_ = false, has_facets_ = false;
  std::vector<std::string> reasons_, unfollowed_;
  std::shared_ptr<HeightFields> fields_;
  HeightFields::Tally kept_;
  std::shared_ptr<KeptMeshes> kept_meshes_;  ///< null: none are kept
  KeptMeshes::Tally kept_tally_;
  std::vector<std::unique_ptr<PreparedMesh>> geometries_;
  std::vector<MovedMesh> moved_;
  std::size_t num_borders_ = 0;  ///< of those, the last ones: strips between others
};

}  // namespace relief
