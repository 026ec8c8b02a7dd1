// Numbers as people read them.
#pragma once

#include <string>

namespace relief {

/// A number with so many significant digits: "0.00123", "12,300", "4.5e-07".
std::string figure_text(double value, int digits = 4);

/// Bytes in the binary unit that suits them: "1.5 MiB".
std::string bytes_text(double bytes);

/// "0.21 ms", "3.2 s", "12 min 5 s", "3 h 20 min".
std::string seconds_text(double seconds);

}  // namespace relief
