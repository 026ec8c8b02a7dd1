// Exit codes of the program: the only list, for main and for the manual.
#pragma once

namespace relief {

enum ExitCode : int { kDone = 0, kFailed = 1, kUsage = 2, kInvalidScene = 3, kInterrupted = 130, kGraceOver = 143 };

struct ExitCodeInfo {
  ExitCode code;
  const char* meaning;
};

inline constexpr ExitCodeInfo kExitCodes[] = {
    {kDone, "done"},
    {kFailed, "a bound of compare was not met, or the run failed"},
    {kUsage, "wrong usage; also an output that is a file the run reads or another output"},
    {kInvalidScene, "the scene, or another input file, is invalid"},
    {kInterrupted, "interrupted; what was rendered is saved"},
    {kGraceOver, "the time that --grace allows was over before all was saved"},
};

}  // namespace relief
