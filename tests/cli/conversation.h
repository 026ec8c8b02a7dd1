// A running `relief serve` that a test talks to.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

#include "tests/cli/program.h"

namespace relief::test {

class Conversation {
 public:
  /// @param errors  descriptor of the process's standard error, closed here
  explicit Conversation(int errors) : input_(pipe_make()), output_(pipe_make()), process_(start(errors)) {}
  ~Conversation()
  {
    close_input();
    ::close(output_.read);
  }
  Conversation(const Conversation&) = delete;
  Conversation& operator=(const Conversation&) = delete;

  void say(const std::string& line) const
  {
    const std::string text = line + "\n";
    ASSERT_EQ(::write(input_.write, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  void ask(const nlohmann::json& id, const Arguments& words) const
  {
    say(nlohmann::json{{"id", id}, {"render", words}}.dump());
  }

  /// The next object that the process prints; null after its last.
  nlohmann::json hear()
  {
    std::size_t end = 0;
    while ((end = heard_.find('\n')) == std::string::npos) {
      char block[4096];
      const ssize_t size = ::read(output_.read, block, sizeof block);
      if (size <= 0) return nullptr;
      heard_.append(block, static_cast<std::size_t>(size));
    }
    nlohmann::json object = nlohmann::json::parse(heard_.substr(0, end), nullptr, false);
    heard_.erase(0, end + 1);
    EXPECT_TRUE(object.is_object());
    return object;
  }
  /// The next object of that event; what comes before it is left out.
  nlohmann::json hear(const std::string& event)
  {
    nlohmann::json object = hear();
    while (!object.is_null() && object.value("event", "") != event) object = hear();
    return object;
  }
  /// What a request ends with, if nothing else is under way.
  nlohmann::json render(const nlohmann::json& id, const Arguments& words)
  {
    ask(id, words);
    return hear("end");
  }

  void close_input()
  {
    if (input_.write >= 0) ::close(std::exchange(input_.write, -1));
  }
  void signal(int number) const { process_.signal(number); }
  int wait() { return process_.wait(); }

 private:
  struct Pipe {
    int read = -1, write = -1;
  };
  static Pipe pipe_make()
  {
    int ends[2];
    EXPECT_EQ(::pipe2(ends, O_CLOEXEC), 0);
    return {ends[0], ends[1]};
  }
  /// The process has the standard input of this one, which therefore is the pipe for a moment.
  Process start(int errors) const
  {
    const StandardInput pipe(input_.read);
    return Process({"serve"}, output_.write, errors);
  }
  struct StandardInput {
    explicit StandardInput(int other) : own(::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 3))
    {
      ::dup2(other, STDIN_FILENO);
      ::close(other);
    }
    ~StandardInput()
    {
      ::dup2(own, STDIN_FILENO);
      ::close(own);
    }
    StandardInput(const StandardInput&) = delete;
    StandardInput& operator=(const StandardInput&) = delete;
    int own;
  };

  Pipe input_, output_;
  std::string heard_;
  Process process_;
};

}  // namespace relief::test
