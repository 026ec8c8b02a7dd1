#include "cli/interrupt.h"

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include <semaphore.h>

#include "cli/exit_code.h"

namespace relief {

namespace {

std::atomic<bool> g_announced{false}, g_stop{false}, g_by_signal{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may not wait for a lock");

sem_t g_grace_begins;
std::atomic<bool> g_has_grace{false};

void on_signal(int number)
{
  g_by_signal = true;
  const bool is_second = g_announced.exchange(true);
  if (is_second) std::_Exit(kInterrupted);
  if (number == SIGTERM && g_has_grace) {
    ::sem_post(&g_grace_begins);
  } else {
    g_stop = true;
  }
}

/// A thread of its own: whatever the others are doing, the program ends in time.
void keep_grace(double seconds)
{
  while (::sem_wait(&g_grace_begins) != 0) {
  }
  const auto half = std::chrono::duration<double>(seconds / 2);
  std::this_thread::sleep_for(half);
  g_stop = true;
  std::this_thread::sleep_for(half);
  std::fputs("relief: the grace time is over: what was not written by now is lost\n", stderr);
  std::_Exit(kGraceOver);
}

}  // namespace

void interrupt_watch(double grace_seconds)
{
  if (grace_seconds > 0 && ::sem_init(&g_grace_begins, 0, 0) == 0) {
    g_has_grace = true;
    std::thread(keep_grace, grace_seconds).detach();
  }
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  if (std::signal(SIGHUP, on_signal) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
}

void interrupt_request() { g_announced = g_stop = true; }

const std::atomic<bool>& interrupt_flag() { return g_stop; }

bool interrupt_is_announced() { return g_announced; }

void interrupt_rest() { g_announced = true; }

void interrupt_begin()
{
  g_announced = g_stop = false;
  if (g_by_signal) interrupt_request();
}

bool interrupt_by_signal() { return g_by_signal; }

}  // namespace relief
