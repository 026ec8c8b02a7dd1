// The displacement methods as parameters of tests.
#pragma once

#include <algorithm>
#include <ostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "displacement/method.h"

namespace relief {

/// How GoogleTest prints a method.
inline void PrintTo(DisplacementMethod method, std::ostream* out) { *out << displacement_method_label(method); }

/// All methods but those that tessellate.
inline std::vector<DisplacementMethod> traversing_methods()
{
  std::vector<DisplacementMethod> methods;
  for (const DisplacementMethod method : kDisplacementMethods) {
    if (displacement_method(method).traverse != nullptr) methods.push_back(method);
  }
  return methods;
}

/// A method's name as that of a test.
inline std::string method_test_name(const testing::TestParamInfo<DisplacementMethod>& test)
{
  std::string name(displacement_method_label(test.param));
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

}  // namespace relief
