#include "benchmarks/displacement/table.h"

#include "exporters/report_html.h"

namespace relief {

std::string markdown(const Table& table)
{
  std::string text;
  if (!table.title.empty()) text += "### " + table.title + "\n\n";
  if (!table.note.empty()) text += table.note + "\n\n";
  const auto line = [&](const std::vector<std::string>& cells) {
    text += "|";
    for (const std::string& cell : cells) text += " " + cell + " |";
    text += "\n";
  };
  line(table.header);
  line(std::vector<std::string>(table.header.size(), "---"));
  for (const auto& row : table.rows) line(row);
  return text + "\n";
}

std::string html(const Table& table)
{
  std::string text;
  if (!table.title.empty()) text += html_heading(table.title, 3);
  if (!table.note.empty()) text += html_paragraph(table.note);
  return text + html_table(table.header, table.rows);
}

}  // namespace relief
