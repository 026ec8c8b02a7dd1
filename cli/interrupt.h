// The wish to stop: from Ctrl-C and its kin, or because nobody listens any more.
#pragma once

#include <atomic>

namespace relief {

/// Turns SIGINT, SIGTERM and SIGHUP into a wish to stop, instead of the end of the program; a second one ends it at once
/// with exit code 130. SIGHUP stays ignored under nohup. SIGPIPE is ignored from here on: a write to a closed pipe fails
/// like any other.
/// @param grace_seconds  from SIGTERM to the end of the program, with exit code 143, whatever it is doing then. The wish to stop
///                       comes after half of them, so that a frame may be finished, and the other half is for writing. 0: the
///                       wish comes at once, and the program takes the time that it needs
void interrupt_watch(double grace_seconds = 0);

/// Wishes to stop, as a signal does.
void interrupt_request();

/// True once somebody wished to stop.
const std::atomic<bool>& interrupt_flag();

/// True once somebody wished to stop, or will when a grace time is half over: nothing more is to be begun.
bool interrupt_is_announced();

/// For a program that works now and then. It rests: there is nothing that could be saved, the first signal ends it at once.
void interrupt_rest();
/// It begins with a piece of work: what was wished for the one before does not count, but a signal does.
void interrupt_begin();
/// Whether a signal was among those who wished to stop.
bool interrupt_by_signal();

}  // namespace relief
