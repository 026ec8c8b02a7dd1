// What the part `vector` of `relief bench displacement` found, as tables and as JSON.
#pragma once

#include <span>

#include <nlohmann/json_fwd.hpp>

#include "benchmarks/displacement/table.h"
#include "benchmarks/displacement/vector_study.h"

namespace relief {

Table vector_table(const VectorResult& scene);
nlohmann::ordered_json vector_json(std::span<const VectorResult> scenes);

}  // namespace relief
