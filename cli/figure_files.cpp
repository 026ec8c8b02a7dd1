#include "cli/figure_files.h"

#include <cerrno>
#include <filesystem>
#include <system_error>

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "cli/standard_streams.h"
#include "exporters/atomic_file.h"
#include "exporters/errors.h"
#include "exporters/svg_plot.h"

namespace relief {

namespace {

constexpr const char* kRasterizer = "rsvg-convert";

/// Runs the rasterizer. @return  false if it is not installed; @error OutputError if it fails
bool rasterize(const std::string& svg, const std::string& png)
{
  std::string words[] = {kRasterizer, "--zoom=2", "--output=" + png, "--", svg};
  char* arguments[] = {words[0].data(), words[1].data(), words[2].data(), words[3].data(), words[4].data(), nullptr};
  pid_t child = 0;
  const int failed = posix_spawnp(&child, kRasterizer, nullptr, nullptr, arguments, environ);
  if (failed == ENOENT) return false;
  int status = 0;
  if (failed != 0 || waitpid(child, &status, 0) < 0 || status != 0) {
    throw OutputError(png, fmt::format("{} could not make it", kRasterizer));
  }
  return true;
}

}  // namespace

void figures_folder_make(const std::string& folder)
{
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw OutputError(folder, failed.message());
}

void figures_write(const RunFiles& files, const std::string& folder, const std::string& page)
{
  bool has_rasterizer = true;
  for (const PlotFile& plot : plot_files(page)) {
    const std::string name = (std::filesystem::path(folder) / plot.name).string();
    for (const char* suffix : {".svg", ".png"}) files.check_output("--figures", name + suffix);
    atomic_write(name + ".svg", plot.svg);
    has_rasterizer = has_rasterizer && rasterize(name + ".svg", name + ".png");
  }
  if (!has_rasterizer) {
    print_warning(fmt::format(
        "--figures: SVG alone; {}, which makes PNG of it, is not installed (Debian: librsvg2-bin)", kRasterizer));
  }
}

}  // namespace relief
