// What a method of tracing displaced triangles is to the rest: an entry with a few functions. Each has a file of its own in
// displacement/methods/, which defines its entry, and a line in kernel/shape/displacement_methods.inc; nothing else
// names it.
#pragma once

#include <optional>
#include <string_view>

#include "displacement/prism_query.h"
#include "displacement/tessellation.h"
#include "kernel/shape/displacement_settings.h"

namespace relief {

/// Processor time that a method takes, nanoseconds. In a tessellation a ray's time grows with the logarithm of the
/// micro-triangles, as the tree and the cache misses do.
/// @source `relief bench displacement --parts costs`, a mean over its scenes and kinds of rays
struct MethodCost {
  double ray = 0;           ///< of tessellations with a million micro-triangles
  double ray_doubling = 0;  ///< more with every doubling of their number
  double build = 0;         ///< a micro-triangle
};

/// Which of RmipOptions a method obeys.
enum class RmipOptionsUse : std::uint8_t { kNone, kBounds, kAll };

struct DisplacementMethodEntry {
  std::string_view title;        ///< in menus
  std::string_view description;  ///< one sentence without a full stop
  /// Nearest (or any) hit of a ray's curve in one triangle; null: the method tessellates.
  /// @param table  MethodTable::view; null where the method makes none
  /// @param hit    written if the result is true
  bool (*traverse)(const PrismQuery& query, const void* table, DisplacedHit* hit) = nullptr;
  /// Null: the height field is all it needs. Methods with the same function share their tables.
  MethodTable (*table_make)(const HeightFieldView& field, const RmipOptions& options) = nullptr;
  RmipOptionsUse rmip_options = RmipOptionsUse::kNone;
  std::optional<TessellationKind> tessellation = {};
  std::optional<MethodCost> cost = {};  ///< of the methods among which `auto` chooses
};

/// The entries, compiled once an instruction set. A method's file defines RELIEF_ISA::NAME_method.
#define X(name, label) extern const DisplacementMethodEntry name##_method;
namespace baseline {
#include "kernel/shape/displacement_methods.inc"
}
namespace avx2 {
#include "kernel/shape/displacement_methods.inc"
}
#undef X

/// What `auto` means where it does not tessellate.
inline constexpr DisplacementMethod kDefaultMethod = DisplacementMethod::chord;

/// Entry of a method, of the first instruction set that was built: plain x86-64, but for programs that are built without it.
/// @pre  not kAuto
const DisplacementMethodEntry& displacement_method(DisplacementMethod method);

/// All methods, in the order of their list.
inline constexpr DisplacementMethod kDisplacementMethods[] = {
#define X(name, label) DisplacementMethod::name,
#include "kernel/shape/displacement_methods.inc"
#undef X
};

}  // namespace relief
