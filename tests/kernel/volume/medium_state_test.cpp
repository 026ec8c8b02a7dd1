#include <gtest/gtest.h>

#include "kernel/state/medium_state.h"

namespace relief {
namespace {

MediumState in_world()
{
  MediumState m{};
  m.inside[m.size++] = kWholeWorld;
  return m;
}

TEST(MediumState, KnowsWhatIsEnteredUntilItIsLeft)
{
  MediumState m = in_world();
  medium_cross(m, 3, true);
  medium_cross(m, 5, true);
  medium_cross(m, 3, false);
  ASSERT_EQ(m.size, 2);
  EXPECT_EQ(m.inside[0], kWholeWorld);
  EXPECT_EQ(m.inside[1], 5);
}

TEST(MediumState, EntersNothingTwiceAndLeavesNothingElse)
{
  MediumState m{};
  medium_cross(m, 3, true);
  medium_cross(m, 3, true);
  medium_cross(m, 4, false);
  EXPECT_EQ(m.size, 1);
}

TEST(MediumState, HasRoomForSoMany)
{
  MediumState m{};
  for (int i = 0; i < 2 * kMostMedia; ++i) medium_cross(m, i, true);
  EXPECT_EQ(m.size, kMostMedia);
}

TEST(MediumState, LeavesAllButTheWorld)
{
  MediumState m = in_world();
  medium_cross(m, 3, true);
  medium_leave_all(m);
  ASSERT_EQ(m.size, 1);
  EXPECT_EQ(m.inside[0], kWholeWorld);
  MediumState alone{};
  medium_cross(alone, 3, true);
  medium_leave_all(alone);
  EXPECT_EQ(alone.size, 0);
}

}  // namespace
}  // namespace relief
