// A world with all that tracing it takes, as a render sets it up, and with its counts at hand.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "benchmarks/displacement/contender.h"
#include "benchmarks/procedural/worlds.h"
#include "displacement/displacement_set.h"

namespace relief {

/// Where a ray hit, as far as the next one needs it.
struct WorldHit {
  bool hit = false;
  Vec3f O, Ng;  ///< where rays leave on the front side; unit
};

class WorldTracer {
 public:
  /// @param world        must outlive the tracer
  /// @param height       of the picture, pixels
  /// @param cache_bytes  of heights that are kept
  /// @error std::runtime_error if Embree fails
  WorldTracer(const World& world, const WorldCells& cells, int height, std::size_t cache_bytes);
  ~WorldTracer();
  WorldTracer(const WorldTracer&) = delete;
  WorldTracer& operator=(const WorldTracer&) = delete;

  /// Traces rays one after another: the nearest hit with its position and normal, or whether there is one.
  /// @return  hits
  std::uint64_t trace(BenchRayKind kind, std::span<const BenchRay> rays, BenchHit* hits) const;
  /// The nearest hit, completed for rays that leave it.
  WorldHit intersect(const BenchRay& ray) const;

  double prepare_seconds() const { return prepare_seconds_; }  ///< wall clock
  std::size_t num_lattices() const { return field_->triangles().size(); }
  double num_micro_triangles() const;  ///< in all, of which few are ever there: N² a lattice
  double most_cells_a_side() const;    ///< along a side of a base triangle, where they are finest
  std::uint64_t num_tiles_made() const { return cache_.tiles.num_made(); }
  std::size_t height_bytes() const { return cache_.bytes(); }
  /// Lattices, prepared triangles and Embree's tree.
  std::size_t prepared_bytes() const { return field_->bytes() + mesh_->bytes() + tree_bytes_; }

 private:
  void build_tree();

  const World& world_;
  LatticeCache cache_;
  DisplacementInput input_;
  std::unique_ptr<ProceduralField> field_;
  std::unique_ptr<DisplacedMesh> mesh_;
  DisplacedGeometry geometry_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  std::size_t tree_bytes_ = 0;
  double prepare_seconds_ = 0;
};

}  // namespace relief
