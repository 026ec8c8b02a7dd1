// What is known of a render: the statistics that it wrote and the attributes of its picture. Either may be missing, or be of
// another version; what is not there is simply not known.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "exporters/picture.h"

namespace relief {

class RenderFacts {
 public:
  /// @param attributes  of the picture
  /// @param statistics  text of a `--stats` file; empty: there is none
  /// @param file        name of that file, for messages
  /// @error InputError if the text is not the statistics of a render
  RenderFacts(Attributes attributes, std::string_view statistics, const std::string& file);

  bool has_statistics() const { return !statistics_.is_null(); }

  /// @param pointer    of the number in the statistics, such as "/rays/total"
  /// @param attribute  that has it too; empty: none
  std::optional<double> number(const std::string& pointer, const std::string& attribute = {}) const;
  /// Text, or a number with all of its digits.
  std::string text(const std::string& pointer, const std::string& attribute = {}) const;

  /// Members of an object of the statistics that are numbers.
  std::vector<std::pair<std::string, double>> numbers(const std::string& pointer) const;

  /// An array or an object of the statistics; null if there is none.
  const nlohmann::ordered_json& value(const std::string& pointer) const;

  std::vector<std::string> warnings() const;

 private:
  Attributes attributes_;
  nlohmann::ordered_json statistics_;
};

}  // namespace relief
