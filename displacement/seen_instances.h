// How large a mesh's instances are in the picture, at any point of it: the largest of all of them counts.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "displacement/picture_view.h"
#include "kernel/math/affine.h"
#include "kernel/shape/mesh_view.h"

namespace relief {

/// Bounds of what instances may show of a metre are sorted, so that those which cannot show more than what is known are not
/// looked at. Instances that overlap where the camera is are all looked at; of a million around it, a few.
class SeenInstances {
 public:
  /// Where detail may be coarser.
  enum class Coarser {
    kOutside,  ///< out of the picture (PictureView::coarsening)
    kAfar      ///< only where the picture is narrow and far from it (PictureView::coarsening_afar)
  };

  /// @param instances  the world from the mesh's own space
  SeenInstances(const MeshView& mesh, const PictureView& view, std::span<const Affine3> instances, Coarser coarser);

  /// Length of a line in the picture, pixels, less where it may be coarser; within a 16th of the longest of all instances.
  /// @param a, b  object space; the same bits either way
  double pixels(Vec3f a, Vec3f b) const;
  /// What a metre is no longer than, anywhere within a ball.
  double most_pixels_a_metre(Vec3d middle, double radius) const;
  /// The same of a metre at a point of the mesh.
  double pixels_a_metre(Vec3d P) const;

  std::size_t bytes() const { return instances_.capacity() * sizeof(Seen); }

 private:
  struct Seen {
    Affine3 world_from_object;
    double stretch;  ///< at most
    double most;     ///< pixels that a metre of object space may be long, anywhere on the mesh
  };
  double coarsening(Vec3d P_world) const;

  PictureView view_;
  Coarser coarser_;
  std::vector<Seen> instances_;  ///< by `most`, from the largest on
};

}  // namespace relief
