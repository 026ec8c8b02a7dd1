#include "exporters/exr_attribute.h"

#include <ImfDoubleAttribute.h>
#include <ImfFloatAttribute.h>
#include <ImfIntAttribute.h>
#include <ImfMatrixAttribute.h>
#include <ImfStringAttribute.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <string_view>
#include <type_traits>

#include "exporters/picture.h"

namespace relief {

namespace {

enum class Kind { kText, kInteger, kNumber, kFloat, kMatrix };

struct NamedKind {
  std::string_view name;
  Kind kind;
};

/// Numbers are doubles: seeds do not fit into OpenEXR's integers.
constexpr NamedKind kKinds[] = {
    {"worldToCamera", Kind::kMatrix},        {"worldToNDC", Kind::kMatrix},
    {"pixelAspectRatio", Kind::kFloat},      {"utcOffset", Kind::kFloat},
    {"relief:seed", Kind::kNumber},          {"relief:frame", Kind::kInteger},
    {"relief:samples", Kind::kNumber},       {"relief:seconds", Kind::kNumber},
    {"relief:threads", Kind::kInteger},      {"relief:error_rmse", Kind::kNumber},
    {"relief:error_relmse", Kind::kNumber},  {"relief:denoise_seconds", Kind::kNumber},
    {"relief:denoised_rmse", Kind::kNumber},
};

/// Up to here doubles count in ones; beyond, text says more.
constexpr double kMostExact = 0x1p53;

Kind kind_of(std::string_view name)
{
  const auto* found =
      std::find_if(std::begin(kKinds), std::end(kKinds), [&](const NamedKind& known) { return known.name == name; });
  return found == std::end(kKinds) ? Kind::kText : found->kind;
}

/// Takes a number from the front of a text, and a blank behind it.
template <class Number>
bool take(std::string_view& text, Number& number)
{
  const auto result = std::from_chars(text.data(), text.data() + text.size(), number);
  if (result.ec != std::errc()) return false;
  text.remove_prefix(static_cast<std::size_t>(result.ptr - text.data()));
  if (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  return true;
}

template <class Attribute, class Number>
bool insert_number(Imf::Header& header, const std::string& name, std::string_view text)
{
  Number number{};
  if (!take(text, number) || !text.empty()) return false;
  if constexpr (std::is_same_v<Number, double>) {
    if (std::fabs(number) > kMostExact) return false;
  }
  header.insert(name, Attribute(number));
  return true;
}

bool insert_matrix(Imf::Header& header, const std::string& name, std::string_view text)
{
  Imath::M44f matrix;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      if (!take(text, matrix[row][column])) return false;
    }
  }
  if (!text.empty()) return false;
  header.insert(name, Imf::M44fAttribute(matrix));
  return true;
}

/// As few digits as tell the number.
std::string shortest_text(double number)
{
  if (std::fabs(number) <= kMostExact && number == std::floor(number)) {
    return std::to_string(static_cast<std::int64_t>(number));
  }
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), number).ptr};
}

std::string matrix_text(const Imath::M44f& matrix)
{
  std::string text;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      text += (text.empty() ? "" : " ") + attribute_number(static_cast<double>(matrix[row][column]));
    }
  }
  return text;
}

}  // namespace

void exr_attribute_insert(Imf::Header& header, const std::string& name, const std::string& text)
{
  bool is_done = false;
  switch (kind_of(name)) {
    case Kind::kText:
      break;
    case Kind::kInteger:
      is_done = insert_number<Imf::IntAttribute, int>(header, name, text);
      break;
    case Kind::kNumber:
      is_done = insert_number<Imf::DoubleAttribute, double>(header, name, text);
      break;
    case Kind::kFloat:
      is_done = insert_number<Imf::FloatAttribute, float>(header, name, text);
      break;
    case Kind::kMatrix:
      is_done = insert_matrix(header, name, text);
      break;
  }
  if (!is_done) header.insert(name, Imf::StringAttribute(text));
}

std::optional<std::string> exr_attribute_text(const std::string& name, const Imf::Attribute& attribute)
{
  if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&attribute)) return text->value();
  if (kind_of(name) == Kind::kText) return {};
  if (const auto* integer = dynamic_cast<const Imf::IntAttribute*>(&attribute)) return std::to_string(integer->value());
  if (const auto* number = dynamic_cast<const Imf::DoubleAttribute*>(&attribute)) return shortest_text(number->value());
  if (const auto* number = dynamic_cast<const Imf::FloatAttribute*>(&attribute)) {
    // All files have this one.
    if (name == "pixelAspectRatio" && number->value() == 1) return {};
    return attribute_number(static_cast<double>(number->value()));
  }
  if (const auto* matrix = dynamic_cast<const Imf::M44fAttribute*>(&attribute)) return matrix_text(matrix->value());
  return {};
}

}  // namespace relief
