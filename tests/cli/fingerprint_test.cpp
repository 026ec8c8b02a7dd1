#include "cli/fingerprint.h"

#include <CLI/CLI.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "exporters/exr.h"
#include "scene/memory.h"
#include "tests/exporters/test_pictures.h"

namespace relief {
namespace {

/// The settings of a command line whose command knows some options of a render, and one that nobody thought of.
std::vector<std::string> settings_of(std::vector<std::string> arguments)
{
  CLI::App app;
  std::string text;
  bool flag = false;
  std::vector<std::string> list;
  for (const char* name : {"scene", "-o,--output", "--png", "--stats", "--frames", "--threads", "--progress",
                           "--reference", "--spp", "--new-setting"}) {
    app.add_option(name, text)->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  }
  for (const char* name : {"--resume", "--strict", "--new-flag"}) app.add_flag(name, flag);
  app.add_option("--new-list", list);
  std::reverse(arguments.begin(), arguments.end());
  app.parse(arguments);
  return settings_given(app);
}

TEST(Fingerprint, AnOptionThatNobodyThoughtOfCounts)
{
  std::set<std::string> all;
  const std::vector<std::vector<std::string>> kDifferent = {{},
                                                            {"--new-setting", "1"},
                                                            {"--new-setting", "2"},
                                                            {"--new-flag"},
                                                            {"--new-list", "a", "b"},
                                                            {"--new-list", "ab"},
                                                            {"--new-list", "b", "a"},
                                                            {"--png", "a.png"},
                                                            {"--stats", "a.json"}};
  for (const auto& arguments : kDifferent) all.insert(render_fingerprint(settings_of(arguments), {}, {}, {}));
  EXPECT_EQ(all.size(), kDifferent.size());
}

TEST(Fingerprint, WhatChangesNoPictureDoesNotCount)
{
  const std::vector<std::string> none = settings_of({"scene.gltf", "-o", "a.exr"});
  EXPECT_EQ(settings_of({"other.gltf", "--output", "b.exr", "--frames", "1-3", "--threads", "2", "--progress", "json",
                         "--reference", "r.exr", "--resume", "--strict"}),
            none);
}

TEST(Fingerprint, DeclaredSettingsCountByWhatTheyAre)
{
  EXPECT_EQ(settings_of({"--spp", "1"}), settings_of({}));
  std::set<std::string> all = {render_fingerprint({}, {}, {}, {})};
  std::size_t num_settings = 0;
  for (std::size_t changed = 0; changed < std::size(kRenderSettings); ++changed) {
    RenderSettings settings;
    num_settings = 0;
    const auto change = [&](auto& value) {
      using Value = std::remove_reference_t<decltype(value)>;
      if (num_settings++ != changed) return;
      if constexpr (std::is_same_v<Value, std::string>) {
        value = "\xff";  // no UTF-8
      } else {
        value = static_cast<Value>(static_cast<double>(value) == 0 ? 1 : 0);
      }
    };
    settings.visit([&](const SettingInfo&, auto& value, const auto&...) { change(value); });
    all.insert(render_fingerprint({}, settings, {}, {}));
  }
  EXPECT_EQ(num_settings, std::size(kRenderSettings));
  EXPECT_EQ(all.size(), num_settings + 1);
}

TEST(Fingerprint, AFrameIsNotTheRestPose)
{
  EXPECT_NE(render_fingerprint({}, {}, {}, {}), render_fingerprint({}, {}, 0, {}));
  EXPECT_NE(render_fingerprint({}, {}, 1, {}), render_fingerprint({}, {}, 0, {}));
}

TEST(Fingerprint, AFileCountsWithAllThatItsSystemSaysButNameAndDevice)
{
  const FileStamp file = {"a.gltf", 1, 2, 3, 4, 5};
  const std::string was = render_fingerprint({}, {}, {}, {file});
  std::vector<FileStamp> changed(4, file);
  changed[0].inode = 7;
  changed[1].bytes = 7;
  changed[2].modified_ns = 7;
  changed[3].changed_ns = 7;
  for (const FileStamp& stamp : changed) EXPECT_NE(render_fingerprint({}, {}, {}, {stamp}), was);
  FileStamp elsewhere = file;
  elsewhere.path = "/share/a.gltf";
  elsewhere.device = 7;
  EXPECT_EQ(render_fingerprint({}, {}, {}, {elsewhere}), was);
  EXPECT_NE(render_fingerprint({}, {}, {}, {file, file}), was);
}

class WholeRender : public FolderTest {};

// As one whose header is damaged: it may claim any size.
TEST_F(WholeRender, IsNoneForWhichThereIsNoRoom)
{
  FramePaths paths;
  paths.exr = file("a.exr");
  exr_write(paths.exr, TestFilm(20, 10, 1).view, frame_attributes(paths, "abc"));
  EXPECT_TRUE(is_whole_render(paths, "abc"));
  memory_limit_set(1);
  EXPECT_FALSE(is_whole_render(paths, "abc"));
  memory_limit_reset();
}

}  // namespace
}  // namespace relief
