#include "cli/interrupt.h"

#include <csignal>
#include <cstdlib>

namespace relief {

namespace {

std::atomic<bool> g_stop{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may not wait for a lock");

void on_signal(int)
{
  if (g_stop.exchange(true)) std::_Exit(130);
}

}  // namespace

void interrupt_watch()
{
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  if (std::signal(SIGHUP, on_signal) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
}

void interrupt_request() { g_stop = true; }

const std::atomic<bool>& interrupt_flag() { return g_stop; }

}  // namespace relief
