// The shells' sides of completion: cli/shell/, as text in the program.
#pragma once

namespace relief {

extern const char* const kBashCompletion;
extern const char* const kZshCompletion;
extern const char* const kFishCompletion;

}  // namespace relief
