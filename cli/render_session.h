// A process that renders one request after the other.
#pragma once

#include <memory>

#include <nlohmann/json.hpp>

#include "cli/kept_frames.h"

namespace relief {

struct RenderSession {
  std::unique_ptr<KeptFrames> kept = std::make_unique<KeptFrames>();  ///< of the requests before
  nlohmann::json request;                                             ///< id of the one that is at work
};

}  // namespace relief
