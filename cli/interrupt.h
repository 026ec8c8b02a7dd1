// The wish to stop: from Ctrl-C and its kin, or because nobody listens any more.
#pragma once

#include <atomic>

namespace relief {

/// Turns SIGINT, SIGTERM and SIGHUP into a wish to stop, instead of the end of the program; a second one ends it at once
/// with exit code 130. SIGHUP stays ignored under nohup. SIGPIPE is ignored from here on: a write to a closed pipe fails
/// like any other.
void interrupt_watch();

/// Wishes to stop, as a signal does.
void interrupt_request();

/// True once somebody wished to stop.
const std::atomic<bool>& interrupt_flag();

}  // namespace relief
