#include "displacement/height_fields.h"

#include <chrono>

namespace relief {

namespace {

/// Adds the time from its beginning to its end.
class Stopwatch {
 public:
  explicit Stopwatch(double* seconds) : seconds_(seconds) {}
  ~Stopwatch() { *seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  double* seconds_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

HeightFields::Key HeightFields::key_of(const Map& map, int level)
{
  const HeightMapView& v = map.view;
  return {v.texels, v.width, v.height, v.format, v.wrap_u, v.wrap_v, level};
}

HeightFields::Entry& HeightFields::entry(const Map& map, int level)
{
  const auto [at, is_new] = entries_.try_emplace(key_of(map, level));
  Entry& entry = at->second;
  entry.is_wanted = true;
  if (!is_new) return entry;
  const Stopwatch time(&entry.seconds);
  entry.owner = map.owner;
  if (level > 0) entry.field.level = HeightLevel(map.view, level);
  entry.field.bounds = HeightField(level > 0 ? entry.field.level.view() : map.view);
  return entry;
}

const HeightFields::Field& HeightFields::field(const Map& map, int level) { return entry(map, level).field; }

const LevelLoss& HeightFields::loss(const Map& map, int level)
{
  std::map<int, LevelLoss>& losses = entry(map, 0).losses;
  const auto known = losses.find(level);
  if (known != losses.end()) return known->second;
  const HeightMapView fine = field(map, level - 1).bounds.view().map, coarse = field(map, level).bounds.view().map;
  return losses[level] = level_loss(fine, coarse);
}

DisplacementLevel HeightFields::level(const Map& map,
                                      int level,
                                      const DisplacementMethodEntry& method,
                                      const RmipOptions& rmip_options)
{
  Entry& e = entry(map, level);
  const HeightFieldView* const view = &e.field.bounds.view();
  if (method.table_make == nullptr) return {view, nullptr};
  const auto [at, is_new] = e.tables.try_emplace({method.table_make, rmip_options.resolution});
  if (is_new) {
    const Stopwatch time(&e.seconds);
    at->second = method.table_make(*view, rmip_options);
  }
  return {view, at->second.view};
}

std::uint64_t HeightFields::Entry::bytes() const
{
  std::uint64_t sum = field.level.bytes() + field.bounds.bytes();
  for (const auto& [key, table] : tables) sum += table.bytes;
  return sum;
}

std::uint64_t HeightFields::bytes() const
{
  std::uint64_t sum = 0;
  for (const auto& [key, entry] : entries_) sum += entry.bytes();
  return sum;
}

HeightFields::Tally HeightFields::end_set()
{
  std::erase_if(entries_, [](const auto& entry) { return !entry.second.is_wanted; });
  Tally tally;
  for (auto& [key, entry] : entries_) {
    if (entry.is_kept) {
      ++tally.count;
      tally.bytes += entry.bytes();
      tally.seconds += entry.seconds;
    }
    entry.is_kept = true;
    entry.is_wanted = false;
  }
  return tally;
}

}  // namespace relief
