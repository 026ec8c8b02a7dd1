// The wish to stop: from Ctrl-C and its kin, or because nobody listens any more.
//
// Whatever the program is doing, it ends within a second. As long as there is nothing that could be saved, it ends at once, whichever
// library it waits for (loading, building, a pipe that nobody writes to). Whoever has something to save says so (KeepsForSaving) and
// looks at interrupt_flag.
#pragma once

#include <atomic>
#include <functional>

#include "cli/exit_code.h"

namespace relief {

/// Turns SIGINT, SIGTERM and SIGHUP into a wish to stop, instead of the end of the program; a second one ends it at once
/// with exit code 130. SIGHUP stays ignored under nohup. To be called once.
void interrupt_watch();

/// Leaves a time between SIGTERM and the wish to stop: half of it, so that a frame may be finished. The other half is for writing;
/// then the program ends with exit code 143, whatever it is doing.
/// @param seconds  from SIGTERM to the end of the program
void interrupt_grace(double seconds);

/// A write to a closed pipe fails from here on like any other.
void broken_pipes_ignore();

/// Wishes to stop, as a signal does, but does not end a program that has nothing to save: it may go on to other work.
void interrupt_request();

/// Ends the program, as a signal does, once nobody has anything to save.
/// @param code  with which it ends then, if no signal comes
void interrupt_end(ExitCode code);

/// True once somebody wished to stop.
const std::atomic<bool>& interrupt_flag();

/// True once somebody wished to stop, or will when a grace time is half over: nothing more is to be begun.
bool interrupt_is_announced();

/// While one lives, it says what is to be told before a program ends that has nothing to save; the newest speaks first, in a thread
/// that is not its owner's.
class Farewell {
 public:
  explicit Farewell(std::function<void()> tell);
  ~Farewell();
  Farewell(const Farewell&) = delete;
  Farewell& operator=(const Farewell&) = delete;
};

/// While one lives, a wish to stop does not end the program: its owner looks at interrupt_flag, saves and ends.
class KeepsForSaving {
 public:
  KeepsForSaving();
  ~KeepsForSaving();
  KeepsForSaving(const KeepsForSaving&) = delete;
  KeepsForSaving& operator=(const KeepsForSaving&) = delete;
};

/// For a program that works now and then. It rests: there is nothing that could be saved, the first signal ends it at once.
void interrupt_rest();
/// It begins with a piece of work: what was wished for the one before does not count, but a signal does.
void interrupt_begin();
/// Whether a signal was among those who wished to stop.
bool interrupt_by_signal();

}  // namespace relief
