// What traces the rays of a benchmark: a scene of Embree's with one geometry, and how its hits are completed.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "displacement/embree_geometry.h"
#include "displacement/tessellation.h"

namespace relief {

enum class BenchRayKind : std::uint8_t { kPrimary, kBounce, kShadow };
inline constexpr std::string_view kBenchRayKindNames[] = {"primary", "bounce", "shadow"};
inline constexpr int kNumBenchRayKinds = 3;

struct BenchRay {
  Vec3f O, D;  ///< D is unit
};

/// A ray from 0 to infinity, as Embree takes it.
RTCRay embree_ray(const BenchRay& ray);
/// The same, with no hit yet.
RTCRayHit embree_ray_hit(const BenchRay& ray);

/// How a ray ended.
struct BenchHit {
  float t = kInfinity;  ///< infinite: missed; shadow rays: 0 if something is in the way
};

class BenchStopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

class BenchTracer {
 public:
  BenchTracer() = default;
  virtual ~BenchTracer();
  BenchTracer(const BenchTracer&) = delete;
  BenchTracer& operator=(const BenchTracer&) = delete;

  /// Traces rays one after another: the nearest hit with its position and normal, or whether there is one.
  /// @param hits      as many as rays
  /// @param counters  sums over the rays; zero for tessellations
  void trace(BenchRayKind kind, std::span<const BenchRay> rays, BenchHit* hits, TraversalCounters& counters) const;
  /// The nearest hit's point, or nothing.
  std::optional<MicroHit> intersect(const BenchRay& ray) const;

  std::size_t tree_bytes() const { return tree_bytes_; }            ///< Embree's
  std::size_t tree_peak_bytes() const { return tree_peak_bytes_; }  ///< while it was built

 protected:
  /// Starts Embree.
  /// @error std::runtime_error if it fails
  RTCDevice start();
  /// Builds the tree.
  /// @param scene     new, of the device
  /// @param geometry  is handed over
  /// @param name      for the error
  /// @error std::runtime_error if Embree fails
  void commit(RTCScene scene, RTCGeometry geometry, const std::string& name);
  RTCScene scene() const { return scene_; }

 private:
  virtual MicroHit point(const RTCHit& hit) const = 0;
  static bool count(void* user, ssize_t bytes, bool post);

  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  std::atomic<std::ptrdiff_t> bytes_{0}, most_bytes_{0};
  std::size_t tree_bytes_ = 0, tree_peak_bytes_ = 0;
};

}  // namespace relief
