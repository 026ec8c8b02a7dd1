// Images as they were read, for the frames after: what one frame asks for and the one before it had is not read again.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "scene/image_reader.h"

namespace relief {

/// What did not have to be made again.
struct KeptTally {
  std::uint64_t count = 0, bytes = 0;
  double seconds = 0;  ///< that making it took
};

/// For use by several threads at once.
class KeptImages {
 public:
  /// What an image is known by: its bytes, or its file as it is now.
  /// @param kind  of what is made of it
  static std::string key(std::string_view kind, const ImageSource& source);

  /// What was made of an image, or makes it. It is kept as long as each frame asks for it.
  /// @tparam T    one for each kind of key; has bytes()
  /// @param make  returns a std::shared_ptr<const T>; what it throws comes through
  template <class T, class Make>
  std::shared_ptr<const T> get(const std::string& key, const Make& make)
  {
    if (const std::shared_ptr<const void> kept = find(key)) return std::static_pointer_cast<const T>(kept);
    const auto start = std::chrono::steady_clock::now();
    std::shared_ptr<const T> made = make();
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    add(key, {made, made->bytes(), taken.count(), true});
    return made;
  }

  /// Ends a frame's questions: what was not asked for goes.
  /// @return  of what was asked for and there
  KeptTally end_frame();
  /// Bytes of all that is there.
  std::uint64_t bytes() const;

 private:
  struct Entry {
    std::shared_ptr<const void> made;
    std::uint64_t bytes;
    double seconds;
    bool is_wanted;
  };
  std::shared_ptr<const void> find(const std::string& key);
  void add(const std::string& key, Entry entry);

  mutable std::mutex mutex_;
  std::map<std::string, Entry> entries_;
  KeptTally reused_;
};

}  // namespace relief
