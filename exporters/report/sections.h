// Sections of the page about a frame that come from its statistics alone. Each is HTML, empty if nothing is known.
#pragma once

#include <string>

#include "exporters/report/render_facts.h"

namespace relief {

/// The figures that matter most, side by side.
/// @param width, height  pixels of the picture
std::string key_figures_html(const RenderFacts& facts, int width, int height);

/// Estimated and measured errors over time, with the slope that independent samples have.
std::string errors_html(const RenderFacts& facts);

/// Where time went, and where memory.
std::string costs_html(const RenderFacts& facts);

/// What was kept from earlier frames of the run, and what was made again.
std::string kept_html(const RenderFacts& facts);

/// Rays, displacement and photons.
std::string work_html(const RenderFacts& facts);

/// The command line and the settings, those first that are not their defaults.
std::string settings_html(const RenderFacts& facts);

std::string warnings_html(const RenderFacts& facts);

}  // namespace relief
