// The study's results as text, JSON and a page.
#pragma once

#include <string>

#include "benchmarks/displacement/study.h"

namespace relief {

/// Tables in Markdown.
std::string bench_markdown(const BenchResults& results);

/// Everything but the pictures.
std::string bench_json(const BenchResults& results);

/// A line for each scene, method and kind of rays.
std::string bench_csv(const BenchResults& results);

/// One page with tables, plots and pictures. @error OutputError
std::string bench_html(const BenchResults& results);

}  // namespace relief
