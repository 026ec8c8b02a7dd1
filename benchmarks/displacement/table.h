// Tables of benchmarks, which are written as Markdown and on a page.
#pragma once

#include <string>
#include <vector>

namespace relief {

/// A table before it is known how it will be written.
struct Table {
  std::string title, note;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
};

std::string markdown(const Table& table);
std::string html(const Table& table);

}  // namespace relief
