// Plots of a page of benchmarks as files, for papers and slides.
#pragma once

#include <string>

#include "cli/run_files.h"

namespace relief {

/// Makes the folder if it is not there. @error OutputError
void figures_folder_make(const std::string& folder);

/// Writes each plot of a page as FOLDER/NN-TITLE.svg, and as .png where rsvg-convert is installed; one warning where it is not.
/// @param page   from report_html.h, with plots of svg_plot.h
/// @param files  of the run; what it reads is not written over
/// @error OutputError
void figures_write(const RunFiles& files, const std::string& folder, const std::string& page);

}  // namespace relief
