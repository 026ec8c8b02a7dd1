// A method with everything that it needs to trace one scene, and what that took.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "benchmarks/displacement/scenes.h"
#include "benchmarks/displacement/tracer.h"
#include "displacement/displaced_mesh.h"
#include "displacement/height_field.h"
#include "displacement/tessellation.h"

namespace relief {

/// What all tessellation-free methods share.
struct BenchSurface {
  explicit BenchSurface(const BenchScene& scene);

  const BenchScene& scene;
  HeightField field;
  DisplacedMesh mesh;
  double field_seconds = 0, mesh_seconds = 0;
};

/// A method and its settings.
struct ContenderSpec {
  std::string name;
  DisplacementMethod method = kDefaultMethod;
  RmipOptions rmip_options = {};
  TessellationBuild build = {};    ///< of a tessellation
  std::uint64_t budget_bytes = 0;  ///< for building it; a rate below 1 is taken where it does not fit
};

/// The largest rate, at most 1, at which building a tessellation stays within a budget.
/// @param budget_bytes  0: any
double tessellation_rate_within(const DisplacedMeshView& mesh,
                                TessellationKind kind,
                                const TessellationBuild& build,
                                std::uint64_t budget_bytes);

class Contender : public BenchTracer {
 public:
  /// @param surface  must outlive the contender
  /// @error std::runtime_error if Embree fails; std::bad_alloc
  Contender(const BenchSurface& surface, const ContenderSpec& spec);

  const ContenderSpec& spec() const { return spec_; }
  double rate() const { return rate_; }  ///< edges a texel; 1 unless a tessellation had to be coarser
  std::uint64_t num_micro_triangles() const;
  std::size_t bytes() const { return table_bytes_ + triangle_bytes_ + tree_bytes(); }
  std::size_t table_bytes() const { return table_bytes_; }        ///< besides the map
  std::size_t triangle_bytes() const { return triangle_bytes_; }  ///< base triangles, or vertices and indices
  double build_seconds() const { return build_seconds_; }  ///< of wall clock, what all methods share included
  /// The part of it that another scale or midlevel asks for again: all but what is made of the map alone.
  double rescale_seconds() const { return rescale_seconds_; }

  /// Has no effect on methods other than RMIP's two.
  void set_rmip_options(const RmipOptions& options) { geometry_.rmip_options = options; }

  /// Bounds and texels of each ray; the nearest hit.
  void count_steps(std::span<const BenchRay> rays, std::uint32_t* steps) const;

 private:
  void build_tessellation();
  void build_tables();
  MicroHit point(const RTCHit& hit) const override;

  const BenchSurface& surface_;
  ContenderSpec spec_;
  double rate_ = 1;
  std::size_t table_bytes_ = 0, triangle_bytes_ = 0;
  double build_seconds_ = 0, rescale_seconds_ = 0;
  MethodTable table_;
  std::unique_ptr<Tessellation> tessellation_;
  DisplacedGeometry geometry_;
};

}  // namespace relief
