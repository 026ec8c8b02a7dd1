// What `relief render` says while it works: a bar on a terminal, one JSON object a line for programs, and notes.
#pragma once

#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "integrator/render.h"

namespace relief {

class ProgressPrinter {
 public:
  /// @param kind  "bar" (drawn on standard error if that is a terminal, and otherwise lines now and then), "json" (on standard
  ///              output) or "none"
  /// @param request  of `relief serve`, its id: all events have it and are printed, whatever the kind; null: there is none
  /// @param log      file that gets what is said, with the time, and lines about progress, whatever the kind; they are added to what it
  ///                 has. Empty: none
  /// @error OutputError if the log cannot be written to
  explicit ProgressPrinter(const std::string& kind, nlohmann::json request = {}, const std::filesystem::path& log = {});

  /// Leaves no half bar behind, whatever ended the render.
  ~ProgressPrinter();
  ProgressPrinter(const ProgressPrinter&) = delete;
  ProgressPrinter& operator=(const ProgressPrinter&) = delete;

  bool is_json() const { return kind_ == Kind::kJson; }
  bool is_of_request() const { return !request_.is_null(); }

  /// Prints the progress of a frame; empty if nobody is to see it.
  /// @param name   of the picture, before lines
  /// @param title  what stands before the bar, such as "frame 7 "
  std::function<void(const RenderProgress&)> callback(int frame, std::string name, std::string title);

  /// Says where nobody sees a bar that a part of the work before sampling is done.
  void phase(const std::string& name, const char* what, double seconds);

  /// Prints a JSON object as a line, in JSON mode only. A reader that has gone away counts as a wish to stop.
  void event(nlohmann::json object);

  /// Prints a line on standard error, above the bar; what is not fit for a terminal is escaped.
  void note(const std::string& line);

  /// Adds a line to the log alone, for what others print.
  void log_line(const std::string& line);

  /// Prints those warnings that this run has not shown yet, in JSON mode also as events.
  void warnings(const std::vector<std::string>& texts);

 private:
  void draw_bar(const std::string& title, const RenderProgress& progress);
  void log(const std::string& name, const RenderProgress& progress);
  void say_of_progress(const std::string& line);
  void clear_bar();

  enum class Kind { kNone, kBar, kLog, kJson } kind_ = Kind::kNone;
  nlohmann::json request_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> log_{nullptr, &std::fclose};
  bool bar_is_drawn_ = false;
  std::set<std::string> shown_;
  double logged_seconds_ = 0, logged_fraction_ = 0;  ///< of the last line about a frame
};

}  // namespace relief
