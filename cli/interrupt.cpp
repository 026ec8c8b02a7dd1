#include "cli/interrupt.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <semaphore.h>

#include "exporters/side_file.h"
#include "scene/diagnostics.h"

namespace relief {

namespace {

std::atomic<bool> g_announced{false}, g_stop{false}, g_by_signal{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may not wait for a lock");

sem_t g_grace_begins, g_end_wished;
std::atomic<bool> g_has_grace{false};
std::atomic<ExitCode> g_end_code{kInterrupted};

/// Held while the program ends, so that nobody begins to save then.
std::mutex g_mutex;
std::atomic<int> g_num_savers{0};
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may not wait for a lock");
std::vector<std::function<void()>> g_farewells;

void wait_for(sem_t& semaphore)
{
  while (::sem_wait(&semaphore) != 0 && errno == EINTR) {
  }
}

/// Whoever has something to save at this moment also ends the program, with an exit code that says whether it was saved: the thread
/// that ends it otherwise may run much later, when nobody saves any more. May be called by a signal handler.
void wish_to_stop()
{
  g_stop = true;
  if (g_num_savers == 0) ::sem_post(&g_end_wished);
}

void on_signal(int number)
{
  g_by_signal = true;
  const bool is_second = g_announced.exchange(true);
  if (is_second) std::_Exit(kInterrupted);
  if (number == SIGTERM && g_has_grace) {
    ::sem_post(&g_grace_begins);
  } else {
    wish_to_stop();
  }
}

/// A thread of its own: whatever the others are doing or waiting for, the program ends in time.
void end_when_wished()
{
  while (true) {
    wait_for(g_end_wished);
    const std::lock_guard lock(g_mutex);
    if (g_num_savers > 0) continue;
    try {
      for (auto tell = g_farewells.rbegin(); tell != g_farewells.rend(); ++tell) (*tell)();
    } catch (const std::exception& error) {
      std::fputs(("relief: " + printable_text(error.what()) + "\n").c_str(), stderr);
    }
    side_files_remove();
    std::_Exit(g_by_signal ? kInterrupted : g_end_code.load());
  }
}

void keep_grace(double seconds)
{
  wait_for(g_grace_begins);
  const auto half = std::chrono::duration<double>(seconds / 2);
  std::this_thread::sleep_for(half);
  wish_to_stop();
  std::this_thread::sleep_for(half);
  std::fputs("relief: the grace time is over: what was not written by now is lost\n", stderr);
  std::_Exit(kGraceOver);
}

}  // namespace

void interrupt_watch()
{
  ::sem_init(&g_end_wished, 0, 0);
  std::thread(end_when_wished).detach();
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  if (std::signal(SIGHUP, on_signal) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
}

void interrupt_grace(double seconds)
{
  if (::sem_init(&g_grace_begins, 0, 0) != 0) return;
  g_has_grace = true;
  std::thread(keep_grace, seconds).detach();
}

void broken_pipes_ignore() { std::signal(SIGPIPE, SIG_IGN); }

void interrupt_request() { g_announced = g_stop = true; }

void interrupt_end(ExitCode code)
{
  g_end_code = code;
  g_announced = true;
  wish_to_stop();
}

const std::atomic<bool>& interrupt_flag() { return g_stop; }

bool interrupt_is_announced() { return g_announced; }

Farewell::Farewell(std::function<void()> tell)
{
  const std::lock_guard lock(g_mutex);
  g_farewells.push_back(std::move(tell));
}

Farewell::~Farewell()
{
  const std::lock_guard lock(g_mutex);
  g_farewells.pop_back();
}

KeepsForSaving::KeepsForSaving()
{
  const std::lock_guard lock(g_mutex);
  ++g_num_savers;
}

KeepsForSaving::~KeepsForSaving()
{
  const std::lock_guard lock(g_mutex);
  --g_num_savers;
}

void interrupt_rest() { g_announced = true; }

void interrupt_begin()
{
  g_announced = g_stop = false;
  if (g_by_signal) interrupt_request();
}

bool interrupt_by_signal() { return g_by_signal; }

}  // namespace relief
