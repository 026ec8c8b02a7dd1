#include "cli/requests.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <string_view>
#include <system_error>
#include <utility>

#include <poll.h>
#include <unistd.h>

#include "cli/failure.h"
#include "cli/interrupt.h"
#include "cli/standard_streams.h"

namespace relief {

namespace {

constexpr const char* kExpected =
    R"(expected {"id": NUMBER OR TEXT, "render": ["SCENE", "-o", "FILE.exr", …]} or {"cancel": ID})";

/// More than any command line has: what follows is no request, and must not take memory without end.
constexpr std::size_t kLongestLine = std::size_t{1} << 22;

/// @param id  null: it is not known whose mistake it is
void answer_mistake(const nlohmann::json& id, const std::string& text)
{
  print_json({{"event", "end"}, {"id", id}, {"exit_code", static_cast<int>(kUsage)}, {"error", text}});
}

void answer_interrupted(const nlohmann::json& id)
{
  print_json({{"event", "end"}, {"id", id}, {"exit_code", static_cast<int>(kInterrupted)}});
}

bool is_id(const nlohmann::json& value) { return value.is_string() || value.is_number(); }

bool is_request(const nlohmann::json& object)
{
  if (object.size() != 2 || !object.contains("id") || !object.contains("render") || !is_id(object["id"])) return false;
  const nlohmann::json& words = object["render"];
  bool are_words = words.is_array();
  // No command line can have a zero in a word, and files would be called by what is before it.
  const auto is_word = [](const nlohmann::json& word) {
    return word.is_string() && word.get_ref<const std::string&>().find('\0') == std::string::npos;
  };
  for (const nlohmann::json& word : words) are_words = are_words && is_word(word);
  return are_words;
}

}  // namespace

Requests::Requests()
{
  if (::pipe(wake_) != 0) throw std::system_error(errno, std::generic_category(), "a pipe");
  thread_ = std::thread([this] { read(); });
}

Requests::~Requests()
{
  ::close(wake_[1]);
  thread_.join();
  ::close(wake_[0]);
}

std::optional<Request> Requests::next()
{
  std::unique_lock lock(mutex_);
  interrupt_rest();
  if (interrupt_by_signal()) return {};
  changed_.wait(lock, [this] { return !waiting_.empty() || has_ended_; });
  if (waiting_.empty()) return {};
  Request request = std::move(waiting_.front());
  waiting_.pop_front();
  at_work_ = request.id;
  interrupt_begin();
  if (!waiting_.empty() || has_ended_) interrupt_request();
  return request;
}

void Requests::finish()
{
  const std::lock_guard lock(mutex_);
  at_work_ = nullptr;
}

void Requests::tell_interrupted()
{
  const std::lock_guard lock(mutex_);
  if (!at_work_.is_null()) answer_interrupted(at_work_);
  for (const Request& request : waiting_) answer_interrupted(request.id);
}

void Requests::read()
{
  std::string text;
  std::array<char, 1 << 16> block;
  while (true) {
    std::array<pollfd, 2> sources = {{{STDIN_FILENO, POLLIN, 0}, {wake_[0], POLLIN, 0}}};
    if (::poll(sources.data(), sources.size(), -1) < 0 && errno == EINTR) continue;
    if (sources[1].revents != 0) return;
    const ssize_t size = ::read(STDIN_FILENO, block.data(), block.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) break;
    std::string_view rest(block.data(), static_cast<std::size_t>(size));
    while (!rest.empty()) {
      const std::size_t end = std::min(rest.find('\n'), rest.size());
      // Of one that is too long the beginning is kept, for nobody; a character more says that it is.
      text += rest.substr(0, std::min(end, kLongestLine + 1 - text.size()));
      rest.remove_prefix(end);
      if (rest.empty()) break;
      rest.remove_prefix(1);
      take(text);
      text.clear();
    }
  }
  if (!text.empty()) take(text);
  end();
}

void Requests::take(const std::string& line)
{
  if (line.size() > kLongestLine) {
    answer_mistake({}, "expected a line of at most " + std::to_string(kLongestLine) + " characters, found a longer one");
    return;
  }
  const nlohmann::json object = nlohmann::json::parse(line, nullptr, false);
  const bool is_cancel = object.is_object() && object.size() == 1 && object.contains("cancel");
  if (is_cancel && is_id(object["cancel"])) {
    const std::lock_guard lock(mutex_);
    // One that has ended has been answered: the two have crossed on the way.
    if (object["cancel"] == at_work_) interrupt_request();
    std::erase_if(waiting_, [&](const Request& request) {
      const bool is_meant = request.id == object["cancel"];
      if (is_meant) answer_interrupted(request.id);
      return is_meant;
    });
    return;
  }
  if (!object.is_object() || !is_request(object)) {
    const bool has_id = object.is_object() && object.contains("id") && is_id(object["id"]);
    answer_mistake(has_id ? object["id"] : nlohmann::json(), kExpected);
    return;
  }
  const std::lock_guard lock(mutex_);
  waiting_.push_back({object["id"], object["render"].get<std::vector<std::string>>()});
  if (!at_work_.is_null()) interrupt_request();
  changed_.notify_one();
}

void Requests::end()
{
  const std::lock_guard lock(mutex_);
  has_ended_ = true;
  if (!at_work_.is_null()) interrupt_end(kDone);
  changed_.notify_one();
}

}  // namespace relief
