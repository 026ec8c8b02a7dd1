#include "scene/graph/graph_schedule.h"

#include <algorithm>
#include <utility>

namespace relief {
namespace {

/// About what an operation costs, in additions.
int cost_of(GraphOp op)
{
  const int outputs = kGraphOpShapes[static_cast<int>(op)].num_outputs;
  if (op >= GraphOp::noise_1d) return 30;
  return outputs > 1 ? 5 : op >= GraphOp::power ? 2 : 1;
}

/// What is needed for the values of one group of guards alone; region 0 is the program.
struct Region {
  std::int32_t parent = -1;
  int depth = 0;
  int cost = 0;
  bool is_kept = true;
  std::vector<std::int32_t> guards;
  std::vector<std::int32_t> from_outside;  ///< operations that it needs and others do, too
};

class Scheduler {
 public:
  Scheduler(std::span<const ScheduleOperation> operations, std::span<const std::int32_t> wanted, std::size_t num_groups)
      : operations_(operations), wanted_(wanted), group_regions_(num_groups, kProgram)
  {
    count_registers();
    find_regions();
    drop_cheap_regions();
    list_needs_from_outside();
  }

  GraphSchedule run();

 private:
  static constexpr std::int32_t kUnused = -1, kProgram = 0;
  /// What regions need from outside is listed for each that it goes through.
  static constexpr int kMostDepth = 16;

  const ScheduleOperation& at(std::int32_t i) const { return operations_[static_cast<std::size_t>(i)]; }
  Region& region(std::int32_t i) { return regions_[static_cast<std::size_t>(i)]; }
  std::int32_t& region_of(std::int32_t operation) { return region_of_[static_cast<std::size_t>(operation)]; }
  bool is_guard(std::int32_t i) const
  {
    return at(i).group >= 0 && static_cast<std::size_t>(at(i).group) < group_regions_.size();
  }
  std::int32_t region_of_group(std::int32_t i) const { return group_regions_[static_cast<std::size_t>(at(i).group)]; }

  void count_registers();
  std::vector<std::int32_t> needs_by_registers(std::int32_t operation) const;
  std::int32_t common(std::int32_t a, std::int32_t b);
  void use_in(std::int32_t operation, std::int32_t region);
  void find_regions();
  void drop_cheap_regions();
  void list_needs_from_outside();

  std::span<const ScheduleOperation> operations_;
  std::span<const std::int32_t> wanted_;
  std::vector<int> registers_;  ///< that each operation takes with all it needs
  std::vector<Region> regions_{1};
  std::vector<std::int32_t> region_of_;      ///< innermost one of each operation
  std::vector<std::int32_t> group_regions_;  ///< kProgram: none, for it is too deep or needs nothing
};

void Scheduler::count_registers()
{
  registers_.assign(operations_.size(), 0);
  for (std::size_t i = 0; i < operations_.size(); ++i) {
    const auto outputs_of = [&](std::size_t n) {
      return kGraphOpShapes[static_cast<int>(operations_[n].op)].num_outputs;
    };
    int most = outputs_of(i), held = 0;
    for (const std::int32_t input : needs_by_registers(static_cast<std::int32_t>(i))) {
      const auto n = static_cast<std::size_t>(input);
      most = std::max(most, held + registers_[n]);
      held += outputs_of(n);
    }
    registers_[i] = most;
  }
}

/// What an operation needs, that first which takes most registers.
std::vector<std::int32_t> Scheduler::needs_by_registers(std::int32_t operation) const
{
  std::vector<std::int32_t> needs = at(operation).needs;
  std::erase(needs, -1);
  std::sort(needs.begin(), needs.end());
  needs.erase(std::unique(needs.begin(), needs.end()), needs.end());
  std::stable_sort(needs.begin(), needs.end(), [&](std::int32_t a, std::int32_t b) {
    return registers_[static_cast<std::size_t>(a)] > registers_[static_cast<std::size_t>(b)];
  });
  return needs;
}

/// The innermost region that two are in.
std::int32_t Scheduler::common(std::int32_t a, std::int32_t b)
{
  while (a != b) (region(a).depth > region(b).depth ? a : b) = region(region(a).depth > region(b).depth ? a : b).parent;
  return a;
}

void Scheduler::use_in(std::int32_t operation, std::int32_t used_in)
{
  if (operation < 0) return;
  std::int32_t& of = region_of(operation);
  of = of == kUnused ? used_in : common(of, used_in);
}

void Scheduler::find_regions()
{
  region_of_.assign(operations_.size(), kUnused);
  for (const std::int32_t operation : wanted_) use_in(operation, kProgram);
  // Users come after what they use, so backwards all users of an operation are known before it.
  for (auto i = static_cast<std::int32_t>(operations_.size()); i-- > 0;) {
    if (is_guard(i)) {
      // Once for the group, from its last guard down to its first.
      if (static_cast<std::size_t>(i) + 1 < operations_.size() && at(i + 1).group == at(i).group) continue;
      std::vector<std::int32_t> guards;
      std::int32_t used_in = kUnused;
      for (std::int32_t k = i; k >= 0 && at(k).group == at(i).group; --k) {
        if (region_of(k) == kUnused) continue;
        guards.push_back(k);
        used_in = used_in == kUnused ? region_of(k) : common(used_in, region_of(k));
      }
      if (guards.empty()) continue;
      std::int32_t inside = used_in;
      if (region(used_in).depth < kMostDepth) {
        inside = static_cast<std::int32_t>(regions_.size());
        regions_.push_back({used_in, region(used_in).depth + 1, 0, true, guards, {}});
        group_regions_[static_cast<std::size_t>(at(i).group)] = inside;
      }
      for (const std::int32_t k : guards) {
        region_of(k) = used_in;
        use_in(at(k).needs[0], inside);
        use_in(at(k).needs[1], used_in);
      }
    } else if (region_of(i) != kUnused) {
      for (const std::int32_t input : at(i).needs) use_in(input, region_of(i));
    }
  }
}

/// A region that costs hardly more than to ask for it is part of its parent.
void Scheduler::drop_cheap_regions()
{
  for (std::size_t i = 0; i < operations_.size(); ++i) {
    if (region_of_[i] != kUnused) region(region_of_[i]).cost += cost_of(operations_[i].op);
  }
  // Parents have lower numbers than what is in them.
  constexpr int kSkipCost = 6;
  for (std::size_t i = regions_.size(); i-- > 1;) {
    regions_[i].is_kept = regions_[i].cost > kSkipCost + 2 * static_cast<int>(regions_[i].guards.size());
    regions_[static_cast<std::size_t>(regions_[i].parent)].cost += regions_[i].cost;
  }
  const auto kept = [this](std::int32_t of) {
    while (!region(of).is_kept) of = region(of).parent;
    return of;
  };
  for (std::size_t i = 1; i < regions_.size(); ++i) regions_[i].parent = kept(regions_[i].parent);
  for (std::int32_t& of : region_of_) of = of == kUnused ? kUnused : kept(of);
  for (std::int32_t& of : group_regions_) of = region(of).is_kept ? of : kProgram;
}

void Scheduler::list_needs_from_outside()
{
  const auto need = [this](std::int32_t input, std::int32_t from) {
    if (input < 0) return;
    for (; from != region_of(input); from = region(from).parent) region(from).from_outside.push_back(input);
  };
  for (std::size_t i = 0; i < operations_.size(); ++i) {
    if (region_of_[i] == kUnused) continue;
    const auto n = static_cast<std::int32_t>(i);
    const std::vector<std::int32_t>& needs = operations_[i].needs;
    if (!is_guard(n) || region_of_group(n) == kProgram) {
      for (const std::int32_t input : needs) need(input, region_of_[i]);
      continue;
    }
    need(needs[0], region_of_group(n));
    need(needs[1], region_of_[i]);
    // The factor decides, so it comes before.
    if (needs[1] >= 0) region(region_of_group(n)).from_outside.push_back(needs[1]);
  }
}

GraphSchedule Scheduler::run()
{
  GraphSchedule out;
  for (const std::int32_t of : group_regions_) out.is_guarded.push_back(of != kProgram ? 1 : 0);
  enum class Task : std::uint8_t { kVisit, kRun, kSkip, kGuards };
  std::vector<std::pair<Task, std::int32_t>> stack;  // the last is done first
  std::vector<char> is_placed(operations_.size(), 0);
  const auto place = [&](std::int32_t operation) {
    is_placed[static_cast<std::size_t>(operation)] = 1;
    out.steps.push_back({ScheduleStep::Kind::kRun, operation});
  };
  for (const std::int32_t first : wanted_) {
    stack.emplace_back(Task::kVisit, first);
    while (!stack.empty()) {
      const auto [task, n] = stack.back();
      stack.pop_back();
      if (task == Task::kSkip) {
        out.steps.push_back({ScheduleStep::Kind::kSkip, n});
      } else if (task == Task::kGuards) {
        out.steps.push_back({ScheduleStep::Kind::kEnd, n});
        for (const std::int32_t guard : region(group_regions_[static_cast<std::size_t>(n)]).guards) place(guard);
      } else if (is_placed[static_cast<std::size_t>(n)] != 0) {
        continue;
      } else if (task == Task::kRun) {
        place(n);
      } else if (!is_guard(n)) {
        stack.emplace_back(Task::kRun, n);
        const std::vector<std::int32_t> needs = needs_by_registers(n);
        for (auto it = needs.rbegin(); it != needs.rend(); ++it) stack.emplace_back(Task::kVisit, *it);
      } else if (region_of_group(n) == kProgram) {
        if (at(n).needs[0] >= 0) stack.emplace_back(Task::kVisit, at(n).needs[0]);
      } else {
        const Region& inside = region(region_of_group(n));
        stack.emplace_back(Task::kGuards, at(n).group);
        for (const std::int32_t guard : inside.guards) {
          if (at(guard).needs[0] >= 0) stack.emplace_back(Task::kVisit, at(guard).needs[0]);
        }
        stack.emplace_back(Task::kSkip, at(n).group);
        for (const std::int32_t outside : inside.from_outside) stack.emplace_back(Task::kVisit, outside);
      }
    }
  }
  return out;
}

}  // namespace

GraphSchedule graph_schedule(std::span<const ScheduleOperation> operations,
                             std::span<const std::int32_t> wanted,
                             std::size_t num_groups)
{
  return Scheduler(operations, wanted, num_groups).run();
}

}  // namespace relief
