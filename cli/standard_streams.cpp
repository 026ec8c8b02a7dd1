#include "cli/standard_streams.h"

#include <cerrno>
#include <cstdio>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "exporters/errors.h"
#include "scene/diagnostics.h"

namespace relief {

void standard_streams_reserve()
{
  int opened = 0;
  do {
    // Open for the other direction, so that whoever uses it is told.
    opened = ::open("/dev/null", O_RDONLY);
  } while (opened >= 0 && opened <= STDERR_FILENO);
  if (opened > STDERR_FILENO) ::close(opened);
}

void print_line(const std::string& line)
{
  const std::string text = printable_text(line) + "\n";
  std::fwrite(text.data(), 1, text.size(), stdout);
}

void print_warning(const std::string& text)
{
  std::fputs(("relief: warning: " + printable_text(text) + "\n").c_str(), stderr);
}

bool print_json(const nlohmann::json& object)
{
  // Paths may hold bytes that are not UTF-8, and characters that command a terminal.
  const std::string line = object.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) + "\n";
  return std::fwrite(line.data(), 1, line.size(), stdout) == line.size() && std::fflush(stdout) == 0;
}

void standard_output_flush()
{
  errno = 0;
  const bool is_flushed = std::fflush(stdout) == 0;
  if (is_flushed && std::ferror(stdout) == 0) return;
  // Of a write that failed earlier only the fact is known.
  throw OutputError("standard output", is_flushed ? "cannot be written" : std::generic_category().message(errno));
}

}  // namespace relief
