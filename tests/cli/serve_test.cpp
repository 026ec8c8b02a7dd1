// `relief serve`: requests on a pipe, what answers them, and that pictures are those of `relief render`.
#include "tests/cli/conversation.h"
#include "tests/support/image_bytes.h"

namespace relief::test {
namespace {

/// Samples that no test waits for.
constexpr const char* kEndless = "16000000";

class Serving : public ProgramTest {
 protected:
  Serving() : scene_(folder_.write("scene.gltf", lit_square().gltf()).string()), server_(open_file("stderr")) {}

  /// Words of a small render.
  Arguments words(const std::string& output, const Arguments& more = {}) const
  {
    Arguments all = render_arguments(scene_, file(output), more);
    all.erase(all.begin());
    return all;
  }

  std::string scene_;
  Conversation server_;
};

TEST_F(Serving, RendersWhatRenderDoes)
{
  const Outcome alone = render(scene_, file("alone.exr"));
  ASSERT_EQ(alone.exit_code, 0) << alone.errors;
  for (const char* name : {"1.exr", "2.exr"}) {
    server_.ask(name, words(name));
    const nlohmann::json progress = server_.hear("progress");
    EXPECT_EQ(progress["id"], name);
    EXPECT_EQ(server_.hear("done")["output"], file(name));
    const nlohmann::json end = server_.hear("end");
    EXPECT_EQ(end["id"], name);
    EXPECT_EQ(end["exit_code"], 0);
    EXPECT_FALSE(end.contains("error"));
    for (const char* channel : {"R", "A", "variance.G"})
      EXPECT_EQ(values_of(file(name), channel), values_of(file("alone.exr"), channel)) << channel;
  }
  server_.close_input();
  EXPECT_TRUE(server_.hear().is_null());
  EXPECT_EQ(server_.wait(), 0);
}

TEST_F(Serving, WhatIsNoRequestIsAnsweredAndSurvived)
{
  for (const char* line :
       {"", "nonsense", "[]", "7", "{\"id\": 1}", "{\"id\": 1, \"render\": \"s.gltf\"}", "{\"id\": 1, \"render\": [1]}",
        "{\"id\": 1, \"render\": [\"a\\u0000b\"]}", "{\"id\": [1], \"render\": []}", "{\"cancel\": {}}",
        "{\"id\": 1, \"render\": [], \"more\": 1}", "\xff\xfe", "{\"id\": 1e999}"}) {
    server_.say(line);
    const nlohmann::json end = server_.hear();
    EXPECT_EQ(end["event"], "end") << line;
    EXPECT_EQ(end["exit_code"], 2) << line;
    EXPECT_NE(end["error"].get<std::string>().find("expected {\"id\""), std::string::npos) << line;
  }
  EXPECT_EQ(server_.render(3, words("o.exr"))["exit_code"], 0);
}

TEST_F(Serving, MistakesHaveTheTextAndCodeOfRender)
{
  const auto expect = [&](const Arguments& of_request, int exit_code, const std::string& text) {
    const nlohmann::json end = server_.render("x", of_request);
    EXPECT_EQ(end["exit_code"], exit_code) << end;
    EXPECT_NE(end.value("error", "").find(text), std::string::npos) << end;
  };
  expect({}, 2, "required");
  expect({"--help"}, 2, "");
  expect(words("o.exr", {"--sp", "4"}), 2, "--sp");
  expect(words("o.png"), 2, ".exr");
  expect({file("none.gltf"), "-o", file("o.exr")}, 3, "none.gltf");
  expect(words("none/o.exr"), 1, "none");
  expect(words("o.exr", {"--max-memory", "0.000001"}), 1, "out of memory");
  // That limit was the last request's alone.
  expect(words("o.exr"), 0, "");
}

TEST_F(Serving, APictureOnStandardOutputIsRefused)
{
  for (const char* name : {"/dev/stdout", "/proc/self/fd/1"}) {
    const nlohmann::json end = server_.render(1, {scene_, "-o", name, "--spp", "1"});
    EXPECT_EQ(end["exit_code"], 2) << end;
    EXPECT_NE(end.value("error", "").find("expected a file, found '" + std::string(name) + "'"), std::string::npos)
        << end;
  }
  EXPECT_EQ(server_.render(2, words("o.exr", {"--stats", "/dev/stdout"}))["exit_code"], 2);
  EXPECT_EQ(server_.render(3, words("o.exr", {"--stats", "/dev/null"}))["exit_code"], 0);
}

TEST_F(Serving, ACancelSavesWhatIsRendered)
{
  server_.ask(1, words("o.exr", {"--spp", kEndless}));
  server_.hear("progress");
  server_.say(R"({"cancel": 2})");
  server_.say(R"({"cancel": 1})");
  EXPECT_EQ(server_.hear("done")["stop_reason"], "interrupted");
  EXPECT_EQ(server_.hear("end")["exit_code"], 130);
  EXPECT_TRUE(exists("o.exr"));
  // It has ended already.
  server_.say(R"({"cancel": 1})");
  EXPECT_EQ(server_.render(3, words("3.exr"))["exit_code"], 0);
}

TEST_F(Serving, ANewRequestTakesThePlaceOfTheOneAtWork)
{
  server_.ask(1, words("1.exr", {"--spp", kEndless}));
  server_.hear("progress");
  server_.ask(2, words("2.exr", {"--spp", kEndless}));
  server_.ask(3, words("3.exr"));
  for (const auto& [id, exit_code] : {std::pair{1, 130}, std::pair{2, 130}, std::pair{3, 0}}) {
    const nlohmann::json end = server_.hear("end");
    EXPECT_EQ(end["id"], id);
    EXPECT_EQ(end["exit_code"], exit_code);
  }
  EXPECT_TRUE(exists("1.exr"));
  EXPECT_TRUE(exists("3.exr"));
}

TEST_F(Serving, TheEndOfInputEndsItWithWhatIsRendered)
{
  server_.ask(1, words("o.exr", {"--spp", kEndless}));
  server_.hear("progress");
  server_.close_input();
  EXPECT_EQ(server_.hear("end")["exit_code"], 130);
  EXPECT_TRUE(server_.hear().is_null());
  EXPECT_EQ(server_.wait(), 0);
  EXPECT_TRUE(exists("o.exr"));
}

TEST_F(Serving, ASignalEndsItWithWhatIsRendered)
{
  server_.ask(1, words("o.exr", {"--spp", kEndless}));
  server_.hear("progress");
  server_.signal(SIGTERM);
  EXPECT_EQ(server_.hear("end")["exit_code"], 130);
  EXPECT_EQ(server_.wait(), 130);
  EXPECT_TRUE(exists("o.exr"));
}

TEST_F(Serving, ASignalEndsItWhereNothingIsAtWork)
{
  EXPECT_EQ(server_.render(1, words("o.exr"))["exit_code"], 0);
  server_.signal(SIGINT);
  EXPECT_EQ(server_.wait(), 130);
}

}  // namespace
}  // namespace relief::test
