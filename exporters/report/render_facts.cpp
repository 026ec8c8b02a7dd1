#include "exporters/report/render_facts.h"

#include <charconv>
#include <cmath>
#include <sstream>

#include "exporters/errors.h"

namespace relief {

using Json = nlohmann::ordered_json;

RenderFacts::RenderFacts(Attributes attributes, std::string_view statistics, const std::string& file)
    : attributes_(std::move(attributes))
{
  if (statistics.empty()) return;
  // What is made of a value goes as deep as the value does.
  constexpr int kDeepest = 100;
  bool is_deep = false;
  const auto keep = [&](int depth, Json::parse_event_t, Json&) { return !(is_deep |= depth > kDeepest); };
  statistics_ = Json::parse(statistics, keep, false);
  if (is_deep || !statistics_.is_object() || !number("/render_seconds")) {
    throw InputError(file, "expected the statistics of a render, as its option --stats writes them");
  }
}

const Json& RenderFacts::value(const std::string& pointer) const
{
  static const Json nothing;
  const Json::json_pointer place(pointer);
  return statistics_.contains(place) ? statistics_.at(place) : nothing;
}

std::optional<double> RenderFacts::number(const std::string& pointer, const std::string& attribute) const
{
  const Json& found = value(pointer);
  if (found.is_number()) return found.get<double>();
  const auto at = attributes_.find(attribute);
  if (at == attributes_.end()) return {};
  double parsed = 0;
  const char* end = at->second.data() + at->second.size();
  const auto result = std::from_chars(at->second.data(), end, parsed);
  // An error that is not known is written as nan.
  if (result.ec != std::errc() || result.ptr != end || !std::isfinite(parsed)) return {};
  return parsed;
}

std::string RenderFacts::text(const std::string& pointer, const std::string& attribute) const
{
  const Json& found = value(pointer);
  if (found.is_string()) return found.get<std::string>();
  if (found.is_number()) return found.dump();
  const auto at = attributes_.find(attribute);
  return at == attributes_.end() ? std::string() : at->second;
}

std::vector<std::pair<std::string, double>> RenderFacts::numbers(const std::string& pointer) const
{
  std::vector<std::pair<std::string, double>> found;
  const Json& object = value(pointer);
  if (!object.is_object()) return found;
  for (const auto& [name, member] : object.items()) {
    if (member.is_number()) found.emplace_back(name, member.get<double>());
  }
  return found;
}

std::vector<std::string> RenderFacts::warnings() const
{
  std::vector<std::string> texts;
  const Json& list = value("/warnings");
  if (list.is_array()) {
    for (const Json& text : list) {
      if (text.is_string()) texts.push_back(text.get<std::string>());
    }
    return texts;
  }
  std::istringstream lines(text({}, "relief:warnings"));
  for (std::string line; std::getline(lines, line);) texts.push_back(line);
  return texts;
}

}  // namespace relief
