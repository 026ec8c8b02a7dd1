#include "cli/memory_option.h"

#include <cstdint>

#include "cli/arguments.h"
#include "scene/memory.h"

namespace relief {

void add_max_memory(CLI::App& command)
{
  const auto set = [](double gib) {
    memory_limit_set(static_cast<std::uint64_t>(gib * static_cast<double>(std::uint64_t{1} << 30)));
  };
  command
      .add_option_function<double>(
          "--max-memory", set,
          "GiB that the run may take; what would take more is an error (default: what the machine "
          "and its control groups have)")
      ->check(number(1e-6, 1e9));
}

}  // namespace relief
