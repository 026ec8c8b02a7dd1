#include "kernel/sample/dimensions.h"

#include <gtest/gtest.h>

#include <set>

namespace relief {
namespace {

TEST(Dimensions, NoTwoUsesShareOne)
{
  std::set<std::uint32_t> seen;
  for (const CameraDimension use : {CameraDimension::kFilm, CameraDimension::kLens}) {
    EXPECT_TRUE(seen.insert(dimension_camera(use)).second);
  }
  for (const PhotonDimension use : {PhotonDimension::kSource, PhotonDimension::kLight, PhotonDimension::kAim}) {
    EXPECT_TRUE(seen.insert(dimension_photon(use)).second);
  }
  EXPECT_TRUE(seen.insert(kLodDimension).second);
  for (int bounce = 0; bounce < 100; ++bounce) {
    for (std::uint32_t use = 0; use < kDimensionsPerBounce; ++use) {
      EXPECT_TRUE(seen.insert(dimension_bounce(bounce, static_cast<BounceDimension>(use))).second);
    }
  }
}

}  // namespace
}  // namespace relief
