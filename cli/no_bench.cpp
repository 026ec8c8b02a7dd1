// In place of cmd_bench.cpp in a program that is built without RELIEF_BUILD_BENCH: says so.
#include <stdexcept>

#include "cli/commands.h"

namespace relief {

void cmd_bench_register(CLI::App& app, Run& run)
{
  CLI::App* bench = app.add_subcommand("bench", "Measures methods side by side (not in this build)");
  bench->allow_extras();
  bench->callback([&run] {
    run = []() -> int {
      throw std::runtime_error(
          "bench is not in this program, which was built without RELIEF_BUILD_BENCH, as scripts/demo does; 'cmake "
          "--preset release' and "
          "'cmake --build --preset release' make the whole one");
    };
  });
}

}  // namespace relief
