#include "scene/kept_images.h"

#include <iterator>
#include <utility>

#include "scene/file_stamp.h"

namespace relief {

std::string KeptImages::key(std::string_view kind, const ImageSource& source)
{
  std::string text(kind);
  if (source.file.empty()) {
    text += " bytes ";
    text.append(reinterpret_cast<const char*>(source.encoded.data()), source.encoded.size());
    return text;
  }
  const FileStamp stamp = file_stamp(source.file);
  for (const std::uint64_t number :
       {stamp.device, stamp.inode, stamp.bytes, static_cast<std::uint64_t>(stamp.modified_ns),
        static_cast<std::uint64_t>(stamp.changed_ns)}) {
    text += " " + std::to_string(number);
  }
  return text + " " + stamp.path;
}

std::shared_ptr<const void> KeptImages::find(const std::string& key)
{
  const std::lock_guard lock(mutex_);
  const auto at = entries_.find(key);
  if (at == entries_.end()) return nullptr;
  Entry& entry = at->second;
  if (!entry.is_wanted) {
    ++reused_.count;
    reused_.bytes += entry.bytes;
    reused_.seconds += entry.seconds;
  }
  entry.is_wanted = true;
  return entry.made;
}

void KeptImages::add(const std::string& key, Entry entry)
{
  const std::lock_guard lock(mutex_);
  entries_.insert_or_assign(key, std::move(entry));
}

KeptTally KeptImages::end_frame()
{
  const std::lock_guard lock(mutex_);
  std::erase_if(entries_, [](const auto& entry) { return !entry.second.is_wanted; });
  for (auto& [key, entry] : entries_) entry.is_wanted = false;
  return std::exchange(reused_, {});
}

std::uint64_t KeptImages::bytes() const
{
  const std::lock_guard lock(mutex_);
  std::uint64_t sum = 0;
  for (const auto& [key, entry] : entries_) sum += entry.bytes;
  return sum;
}

}  // namespace relief
