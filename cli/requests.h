// What `relief serve` is asked for on standard input, a JSON object a line. A thread of its own reads, so that a line that
// comes while a request is at work is heard at once.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

namespace relief {

/// {"id": ID, "render": [WORD, …]}
struct Request {
  nlohmann::json id;               ///< a number or a text
  std::vector<std::string> words;  ///< of the command line, after `relief render`
};

/// Reads standard input until it ends. A new request, a cancellation of the one at work and the end of input wish for an
/// interrupt. Lines that are no request are answered by the thread that reads.
class Requests {
 public:
  Requests();
  ~Requests();
  Requests(const Requests&) = delete;
  Requests& operator=(const Requests&) = delete;

  /// Ends the request before, and waits for the next. If that is not wanted any more, the interrupt flag is set.
  /// @return empty: there will be no other
  std::optional<Request> next();

  /// Says that the request at work has been answered.
  void finish();

  /// Answers all that have not been answered that they were interrupted, from any thread, before the program ends.
  void tell_interrupted();

 private:
  void read();
  void take(const std::string& line);
  void end();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Request> waiting_;
  nlohmann::json at_work_;  ///< its id; null: none is
  bool has_ended_ = false;
  int wake_[2] = {-1, -1};  ///< a pipe that ends the thread
  std::thread thread_;      ///< the last member: it uses all others
};

}  // namespace relief
