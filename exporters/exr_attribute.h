// Attributes of OpenEXR files. In memory all are text; in files what is a number is one, and what is a matrix is one, by its name.
#pragma once

#include <optional>
#include <string>

#include <ImfHeader.h>

namespace relief {

/// Gives a part an attribute: of the type that its name stands for if the text has it, and else text.
void exr_attribute_insert(Imf::Header& header, const std::string& name, const std::string& text);

/// The attribute as text that exr_attribute_insert makes the same of. @return nothing if it is of a type that is not written
std::optional<std::string> exr_attribute_text(const std::string& name, const Imf::Attribute& attribute);

}  // namespace relief
