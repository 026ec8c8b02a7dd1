// Ends TBB's threads before the search for leaks at exit. LeakSanitizer reads the thread-local storage of every thread that it finds,
// and dies if a worker's is given back meanwhile ("Tracer caught signal 11"; google/sanitizers issue 1353).
#include <tbb/global_control.h>

#include <new>

namespace {

/// Made after the sanitizer and TBB, so it ends before both.
const struct TbbAtExit {
  tbb::task_scheduler_handle handle{tbb::attach{}};

  TbbAtExit() = default;
  TbbAtExit(const TbbAtExit&) = delete;
  TbbAtExit& operator=(const TbbAtExit&) = delete;
  ~TbbAtExit() { static_cast<void>(tbb::finalize(handle, std::nothrow)); }
} g_tbb_at_exit;

}  // namespace
