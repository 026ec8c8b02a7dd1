#include "displacement/method.h"

namespace relief {

const DisplacementMethodEntry& displacement_method(DisplacementMethod method)
{
  static constexpr const DisplacementMethodEntry* kEntries[] = {
#define X(name, label) &RELIEF_ENTRIES_ISA::name##_method,
#include "kernel/shape/displacement_methods.inc"
#undef X
  };
  return *kEntries[static_cast<int>(method) - 1];
}

}  // namespace relief
