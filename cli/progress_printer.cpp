#include "cli/progress_printer.h"

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>

#include <unistd.h>

#include <fmt/format.h>

#include "cli/interrupt.h"
#include "cli/memory_use.h"
#include "cli/standard_streams.h"
#include "exporters/errors.h"
#include "scene/diagnostics.h"

namespace relief {

namespace {

/// Unlike fmt::print, a failure is no exception: messages must not cost a finished render its files.
bool write_text(std::FILE* stream, const std::string& text)
{
  return std::fwrite(text.data(), 1, text.size(), stream) == text.size() && std::fflush(stream) == 0;
}

std::string duration_text(double seconds)
{
  if (seconds < 100) return fmt::format("{:.0f} s", seconds);
  const long long minutes = std::llround(seconds / 60);
  return minutes < 100 ? fmt::format("{} min", minutes) : fmt::format("{} h {:02} min", minutes / 60, minutes % 60);
}

}  // namespace

ProgressPrinter::ProgressPrinter(const std::string& kind, nlohmann::json request, const std::filesystem::path& log)
    : request_(std::move(request))
{
  if (!log.empty()) {
    log_.reset(std::fopen(log.c_str(), "a"));
    if (!log_) throw OutputError(log.string(), std::strerror(errno));
  }
  if (kind == "json" || !request_.is_null()) kind_ = Kind::kJson;
  if (kind_ == Kind::kNone && kind == "bar") kind_ = isatty(STDERR_FILENO) != 0 ? Kind::kBar : Kind::kLog;
}

ProgressPrinter::~ProgressPrinter() { clear_bar(); }

std::function<void(const RenderProgress&)> ProgressPrinter::callback(int frame, std::string name, std::string title)
{
  logged_seconds_ = logged_fraction_ = 0;
  if (kind_ == Kind::kNone && !log_) return {};
  return [this, frame, name = std::move(name), title = std::move(title)](const RenderProgress& p) {
    if (kind_ == Kind::kLog || log_) log(name, p);
    if (kind_ == Kind::kBar) draw_bar(title, p);
    if (kind_ != Kind::kJson) return;
    event({{"event", "progress"},
           {"frame", frame},
           {"fraction", p.fraction},
           {"samples", p.samples_per_pixel},
           {"photons", p.photons},
           {"seconds", p.seconds},
           {"seconds_left", p.seconds_left},
           {"rays_per_second", p.rays_per_second},
           {"memory_bytes", memory_bytes()},
           {"peak_memory_bytes", peak_memory_bytes()}});
  };
}

void ProgressPrinter::say_of_progress(const std::string& line)
{
  if (kind_ == Kind::kLog) {
    note(line);
  } else {
    log_line(line);
  }
}

void ProgressPrinter::log_line(const std::string& line)
{
  if (!log_) return;
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  char stamp[32] = "";
  if (gmtime_r(&now, &utc) != nullptr) std::strftime(stamp, sizeof(stamp), "%FT%TZ", &utc);
  write_text(log_.get(), fmt::format("{} {}\n", stamp, printable_text(line)));
}

void ProgressPrinter::log(const std::string& name, const RenderProgress& p)
{
  // A log is read later: what is new, seldom enough to be looked through.
  constexpr double kMostSeconds = 10, kLeastSeconds = 1, kShare = 0.05;
  const double waited = p.seconds - logged_seconds_;
  if (waited < kLeastSeconds || (waited < kMostSeconds && p.fraction < logged_fraction_ + kShare)) return;
  logged_seconds_ = p.seconds;
  logged_fraction_ = p.fraction;
  say_of_progress(fmt::format("{}: {:.0f} % after {}, {} left, {:.4g} samples a pixel", name, 100 * p.fraction,
                              duration_text(p.seconds), duration_text(p.seconds_left), p.samples_per_pixel));
}

void ProgressPrinter::phase(const std::string& name, const char* what, double seconds)
{
  say_of_progress(fmt::format("{}: {} in {:.2f} s", name, what, seconds));
}

void ProgressPrinter::event(nlohmann::json object)
{
  if (kind_ != Kind::kJson) return;
  if (!request_.is_null()) object["id"] = request_;
  if (print_json(object)) return;
  kind_ = Kind::kNone;
  // Nobody needs to be told a second time, at the end.
  std::clearerr(stdout);
  interrupt_request();
  note("relief: nobody reads the progress any more: stopping");
}

void ProgressPrinter::note(const std::string& line)
{
  clear_bar();
  write_text(stderr, printable_text(line) + "\n");
  log_line(line);
}

void ProgressPrinter::warnings(const std::vector<std::string>& texts)
{
  for (const std::string& text : texts) {
    if (!shown_.insert(text).second) continue;
    note("relief: warning: " + text);
    event({{"event", "warning"}, {"text", text}});
  }
}

void ProgressPrinter::draw_bar(const std::string& title, const RenderProgress& p)
{
  constexpr int kWidth = 30;
  const int done = static_cast<int>(p.fraction * kWidth);
  const std::string photons =
      p.photons > 0 ? fmt::format("  {:.1f} M photons", static_cast<double>(p.photons) * 1e-6) : "";
  bar_is_drawn_ = true;
  write_text(stderr, fmt::format("\r{}[{:#<{}}{: <{}}] {:3.0f}%  {:.0f} spp{}  {} left  {:.2f} Mrays/s\033[K", title,
                                 "", done, "", kWidth - done, 100 * p.fraction, p.samples_per_pixel, photons,
                                 duration_text(p.seconds_left), p.rays_per_second * 1e-6));
}

void ProgressPrinter::clear_bar()
{
  if (bar_is_drawn_) write_text(stderr, "\r\033[K");
  bar_is_drawn_ = false;
}

}  // namespace relief
