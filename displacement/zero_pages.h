// Memory that is all zeros and takes none until it is written to.
#pragma once

#include <cstddef>
#include <new>

#include <sys/mman.h>

namespace relief {

class ZeroPages {
 public:
  /// @error  std::bad_alloc
  explicit ZeroPages(std::size_t bytes)
      : bytes_(bytes),
        data_(mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0))
  {
    if (data_ == MAP_FAILED) throw std::bad_alloc();
  }
  ZeroPages(const ZeroPages&) = delete;
  ZeroPages& operator=(const ZeroPages&) = delete;
  ~ZeroPages() { munmap(data_, bytes_); }

  void* data() const { return data_; }

 private:
  std::size_t bytes_;
  void* data_;
};

}  // namespace relief
