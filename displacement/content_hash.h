// A fingerprint of data in memory, by which what was made of it is found again when the same comes once more.
#pragma once

#include <bit>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace relief {

/// 128 bits: that two different contents of a session share them is out of the question, as nobody chooses them to.
struct ContentHash {
  std::uint64_t a = 0, b = 0;
  auto operator<=>(const ContentHash&) const = default;
};

/// Two lanes, each of which takes all words: for the same state another word gives another state.
/// @source the rounds of xxHash (Collet 2012), with other shifts and constants in the second lane
class ContentHasher {
 public:
  void add_bytes(const void* bytes, std::size_t size)
  {
    const auto* at = static_cast<const unsigned char*>(bytes);
    add_word(size);
    for (; size >= 8; size -= 8, at += 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, at, 8);
      add_word(word);
    }
    std::uint64_t word = 0;
    std::memcpy(&word, at, size);
    add_word(word);
  }

  /// @param first  null: an array that is absent, another than one that is empty
  template <class T>
  void add_array(const T* first, std::size_t count)
  {
    static_assert(std::is_trivially_copyable_v<T>);
    add_word(first != nullptr ? 1 : 0);
    if (first != nullptr) add_bytes(first, count * sizeof(T));
  }

  /// @param values  without padding: numbers, enumerators, pointers
  template <class... T>
  void add(const T&... values)
  {
    static_assert((std::is_scalar_v<T> && ...));
    (add_bytes(&values, sizeof values), ...);
  }

  ContentHash result() const { return {mixed(a_), mixed(b_ ^ kOdd)}; }

 private:
  static constexpr std::uint64_t kOdd = 0x9e3779b97f4a7c15, kOther = 0xc2b2ae3d27d4eb4f;

  static std::uint64_t mixed(std::uint64_t x)
  {
    x = (x ^ (x >> 33)) * kOther;
    x = (x ^ (x >> 29)) * kOdd;
    return x ^ (x >> 32);
  }
  void add_word(std::uint64_t word)
  {
    a_ = std::rotl(a_ + word * kOther, 31) * kOdd;
    b_ = std::rotl(b_ ^ (word * kOdd), 27) * kOther + 0x165667b19e3779f9;
  }

  std::uint64_t a_ = kOdd, b_ = kOther;
};

}  // namespace relief
