#include "exporters/atomic_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <thread>

#include "exporters/errors.h"
#include "exporters/output_lock.h"
#include "exporters/side_file.h"
#include "tests/exporters/test_pictures.h"

namespace {

/// What the process asked of the disk, in order, while that is recorded.
std::vector<std::string> disk_calls;
std::atomic<bool> is_recorded = false;
/// What fsync fails with; 0: nothing.
std::atomic<int> fsync_error = 0;

void record(const std::string& call)
{
  if (is_recorded) disk_calls.push_back(call);
}

}  // namespace

// In the place of the C library's: no test can cut the power.
extern "C" int fsync(int descriptor)
{
  struct stat status {};
  ::fstat(descriptor, &status);
  record(S_ISDIR(status.st_mode) ? "fsync folder" : "fsync " + std::to_string(status.st_size) + " bytes");
  errno = fsync_error;
  return fsync_error == 0 ? 0 : -1;
}

extern "C" int rename(const char* from, const char* to) noexcept
{
  record("rename");
  return ::renameat(AT_FDCWD, from, AT_FDCWD, to);
}

namespace relief {

using AtomicFileTest = FolderTest;

TEST_F(AtomicFileTest, ItsBytesAreOnTheDiskBeforeItsName)
{
  is_recorded = true;
  atomic_write(file("a.txt"), "12345");
  is_recorded = false;
  EXPECT_EQ(disk_calls, (std::vector<std::string>{"fsync 5 bytes", "rename", "fsync folder"}));
}

TEST_F(AtomicFileTest, BytesThatDoNotReachTheDiskLeaveTheOldFile)
{
  write_bytes(file("a.txt"), "old");
  fsync_error = EIO;
  EXPECT_THROW(atomic_write(file("a.txt"), "new"), OutputError);
  fsync_error = EINVAL;  // of a file system that knows no such thing
  EXPECT_EQ(bytes_of_file(file("a.txt")), "old");
  EXPECT_EQ(files_in_folder(), std::vector<std::string>{"a.txt"});
  atomic_write(file("a.txt"), "new");
  fsync_error = 0;
  EXPECT_EQ(bytes_of_file(file("a.txt")), "new");
}

TEST_F(AtomicFileTest, IsInvisibleUntilCommitted)
{
  AtomicFile output(file("a.txt"));
  output.write("new", 3);
  EXPECT_FALSE(std::filesystem::exists(file("a.txt")));
  output.commit();
  EXPECT_EQ(bytes_of_file(file("a.txt")), "new");
  EXPECT_EQ(files_in_folder(), std::vector<std::string>{"a.txt"});
}

TEST_F(AtomicFileTest, AnInterruptedWriterLeavesTheOldFileAndNothingElse)
{
  write_bytes(file("a.txt"), "old");
  try {
    AtomicFile output(file("a.txt"));
    output.write("half of the n", 13);
    throw std::runtime_error("interrupted");
  } catch (const std::runtime_error&) {
  }
  EXPECT_EQ(bytes_of_file(file("a.txt")), "old");
  EXPECT_EQ(files_in_folder(), std::vector<std::string>{"a.txt"});
}

TEST_F(AtomicFileTest, SeeksLikeAFile)
{
  AtomicFile output(file("a.txt"));
  output.write("abcdef", 6);
  output.seek(2);
  output.write("XY", 2);
  EXPECT_EQ(output.position(), 4u);
  output.commit();
  EXPECT_EQ(bytes_of_file(file("a.txt")), "abXYef");
}

TEST_F(AtomicFileTest, AMissingFolderIsAnErrorThatNamesTheFile)
{
  try {
    atomic_write(file("nowhere/a.txt"), "x");
    FAIL() << "no error";
  } catch (const OutputError& error) {
    EXPECT_EQ(error.file, file("nowhere/a.txt").string());
    EXPECT_EQ(error.cause, "No such file or directory");
  }
}

TEST_F(AtomicFileTest, AFolderCannotBeOverwritten) { EXPECT_THROW(atomic_write(folder_, "x"), OutputError); }

TEST_F(AtomicFileTest, AFullDiskIsAnError)
{
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  EXPECT_THROW(atomic_write("/dev/full", "x"), OutputError);
  EXPECT_TRUE(std::filesystem::exists("/dev/full"));
}

TEST_F(AtomicFileTest, AFailureThatNobodyListenedToIsReportedAtTheEnd)
{
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit old{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &old), 0);
  const rlimit nothing = {0, old.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &nothing), 0);
  {
    AtomicFile output(file("a.txt"));
    output.write("x", 1);
    // The seek flushes, fails, and leaves nothing in the buffer that could fail again.
    EXPECT_THROW(output.seek(0), OutputError);
    EXPECT_THROW(output.commit(), OutputError);
  }
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &old), 0);
  EXPECT_TRUE(files_in_folder().empty());
}

TEST_F(AtomicFileTest, ADeviceIsWrittenAndNotReplaced)
{
  atomic_write("/dev/null", "x");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

TEST_F(AtomicFileTest, FollowsASymbolicLink)
{
  write_bytes(file("real.txt"), "old");
  std::filesystem::create_symlink("real.txt", file("link.txt"));
  atomic_write(file("link.txt"), "new");
  EXPECT_TRUE(std::filesystem::is_symlink(file("link.txt")));
  EXPECT_EQ(bytes_of_file(file("real.txt")), "new");
}

TEST_F(AtomicFileTest, MakesTheFileThatALinkAsksFor)
{
  std::filesystem::create_directory(file("there"));
  std::filesystem::create_symlink("second.txt", file("first.txt"));
  std::filesystem::create_symlink("there/new.txt", file("second.txt"));
  atomic_write(file("first.txt"), "new");
  EXPECT_TRUE(std::filesystem::is_symlink(file("first.txt")));
  EXPECT_TRUE(std::filesystem::is_symlink(file("second.txt")));
  EXPECT_EQ(bytes_of_file(file("there/new.txt")), "new");
  std::filesystem::create_symlink("b.txt", file("a.txt"));
  std::filesystem::create_symlink("a.txt", file("b.txt"));
  EXPECT_THROW(atomic_write(file("a.txt"), "x"), OutputError);
}

TEST_F(AtomicFileTest, KeepsPermissionsAndOwnerAndMakesNewFilesAsTheMaskSays)
{
  const auto mode_of = [&](const char* name) {
    struct stat status {};
    EXPECT_EQ(::stat(file(name).c_str(), &status), 0);
    return status.st_mode & 07777u;
  };
  const mode_t old_mask = ::umask(027);
  atomic_write(file("new.txt"), "x");
  ::umask(old_mask);
  EXPECT_EQ(mode_of("new.txt"), 0640u);
  for (const mode_t mode : {mode_t{0600}, mode_t{0666}, mode_t{0640}}) {
    write_bytes(file("old.txt"), "old");
    ASSERT_EQ(::chmod(file("old.txt").c_str(), mode), 0);
    const bool may_give_away = ::chown(file("old.txt").c_str(), 1234, 1235) == 0;
    atomic_write(file("old.txt"), "new");
    EXPECT_EQ(mode_of("old.txt"), mode);
    struct stat status {};
    ASSERT_EQ(::stat(file("old.txt").c_str(), &status), 0);
    if (may_give_away) {
      EXPECT_EQ(status.st_uid, 1234u);
      EXPECT_EQ(status.st_gid, 1235u);
    }
  }
}

TEST_F(AtomicFileTest, AFileThatMayNotBeWrittenIsLeftAlone)
{
  std::filesystem::permissions(folder_, std::filesystem::perms::all);
  write_bytes(file("a.txt"), "old");
  ASSERT_EQ(::chmod(file("a.txt").c_str(), 0444), 0);
  const pid_t child = fork();
  if (child == 0) {
    // The superuser may write anything.
    if (::geteuid() == 0 && (::setgid(65534) != 0 || ::setuid(65534) != 0)) _exit(2);
    try {
      atomic_write(file("a.txt"), "new");
    } catch (const OutputError& error) {
      _exit(error.cause == "Permission denied" ? 0 : 3);
    }
    _exit(4);
  }
  int status = -1;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(bytes_of_file(file("a.txt")), "old");
}

TEST_F(AtomicFileTest, TakesNamesOfEveryLength)
{
  for (const std::size_t length : {1u, 233u, 234u, 254u, 255u}) {
    atomic_write(file(std::string(length, 'n')), "x");
    EXPECT_EQ(bytes_of_file(file(std::string(length, 'n'))), "x") << length;
  }
  try {
    AtomicFile output(file(std::string(256, 'n')));
    FAIL() << "found too late";
  } catch (const OutputError& error) {
    EXPECT_EQ(error.cause, "File name too long");
  }
}

TEST_F(AtomicFileTest, AnOpenFileIsWrittenAtItsPosition)
{
  write_bytes(file("log.txt"), "first\n");
  const int log = ::open(file("log.txt").c_str(), O_WRONLY | O_APPEND);
  AtomicFile output("/dev/fd/" + std::to_string(log));
  output.write("??cond\n", 7);
  output.seek(0);
  output.write("se", 2);
  output.commit();
  EXPECT_EQ(::close(log), 0);
  EXPECT_EQ(bytes_of_file(file("log.txt")), "first\nsecond\n");
  EXPECT_EQ(files_in_folder(), std::vector<std::string>{"log.txt"});
}

TEST_F(AtomicFileTest, LeftoversOfTheDeadAreRemovedAndNothingElse)
{
  const pid_t child = fork();
  if (child == 0) {
    AtomicFile unfinished(file("a.txt"));
    _exit(0);
  }
  int status = -1;
  waitpid(child, &status, 0);
  ASSERT_EQ(files_in_folder().size(), 1u);
  const std::string leftover = files_in_folder().front();
  // Another machine's, whose process may live; a name that only looks like it; a link; somebody's own.
  std::string foreign = leftover;
  foreign[8] = foreign[8] == '0' ? '1' : '0';
  write_bytes(file(foreign), "");
  write_bytes(file(leftover.substr(0, leftover.size() - 5) + "x.tmp"), "");
  write_bytes(file("precious"), "mine");
  std::string link = leftover;
  link[20] = link[20] == '0' ? '1' : '0';
  std::filesystem::create_symlink("precious", file(link));
  AtomicFile alive(file("b.txt"));
  EXPECT_FALSE(std::filesystem::exists(file(leftover)));
  side_files_clean(folder_);
  EXPECT_EQ(files_in_folder().size(), 5u);
  alive.commit();
  EXPECT_TRUE(std::filesystem::exists(file("b.txt")));
  EXPECT_EQ(bytes_of_file(file("precious")), "mine");
}

TEST_F(AtomicFileTest, CleaningNeverTakesAFileFromItsWriter)
{
  std::atomic<bool> is_done = false;
  std::thread cleaner([&] {
    while (!is_done) side_files_clean(folder_);
  });
  for (int i = 0; i < 2000; ++i) EXPECT_NO_THROW(atomic_write(file("a.txt"), "x"));
  is_done = true;
  cleaner.join();
  EXPECT_EQ(files_in_folder(), std::vector<std::string>{"a.txt"});
}

TEST_F(AtomicFileTest, LocksOfTheDeadAreRemovedThoughTheyDiedBeforeTheySigned)
{
  const std::string start = ".relief-0123456789abcde";
  write_bytes(file(start + "0.lock"), "");
  write_bytes(file(start + "1.lock"), "process 1 on " + host_name() + "\n");
  write_bytes(file(start + "2.lock"), "process 1 on another machine\n");
  side_files_clean(folder_);
  EXPECT_EQ(files_in_folder(), std::vector<std::string>{start + "2.lock"});
}

TEST_F(AtomicFileTest, CleaningNeverTakesALockFromItsHolder)
{
  std::atomic<bool> is_done = false;
  std::thread cleaner([&] {
    while (!is_done) side_files_clean(folder_);
  });
  for (int i = 0; i < 2000; ++i) EXPECT_EQ(OutputLock(file("a.txt")).holder(), "");
  is_done = true;
  cleaner.join();
  EXPECT_TRUE(files_in_folder().empty());
}

TEST_F(AtomicFileTest, ALockHasOneHolderAndSaysWho)
{
  {
    const OutputLock first(file("a.txt"));
    EXPECT_EQ(first.holder(), "");
    std::filesystem::create_symlink("a.txt", file("link.txt"));
    const OutputLock second(file("link.txt")), other(file("b.txt")), none("/dev/null"), empty("");
    EXPECT_EQ(second.holder(), "process " + std::to_string(::getpid()) + " on " + host_name());
    EXPECT_EQ(other.holder() + none.holder() + empty.holder(), "");
  }
  EXPECT_EQ(OutputLock(file("a.txt")).holder(), "");
  EXPECT_EQ(files_in_folder(), std::vector<std::string>{"link.txt"});
  EXPECT_THROW(OutputLock(file("nowhere/a.txt")), OutputError);
}

TEST_F(AtomicFileTest, ALockThatIsAnotherNameOfAFileLeavesItAlone)
{
  write_bytes(file("precious"), "mine");
  const std::string lock = lock_name_of("a.txt");
  std::filesystem::create_hard_link(file("precious"), file(lock));
  {
    const OutputLock first(file("a.txt"));
    EXPECT_EQ(first.holder(), "");
    EXPECT_EQ(bytes_of_file(file("precious")), "mine");
    EXPECT_EQ(OutputLock(file("a.txt")).holder(), "process " + std::to_string(::getpid()) + " on " + host_name());
  }
  EXPECT_EQ(bytes_of_file(file("precious")), "mine");
  std::filesystem::create_symlink("precious", file(lock));
  EXPECT_THROW(OutputLock(file("a.txt")), OutputError);
  std::filesystem::remove(file(lock));
  ASSERT_EQ(::mkfifo(file(lock).c_str(), 0600), 0);
  EXPECT_EQ(OutputLock(file("a.txt")).holder(), "") << "nobody waits for a pipe";
  EXPECT_EQ(bytes_of_file(file("precious")), "mine");
  EXPECT_EQ(files_in_folder(), std::vector<std::string>{"precious"});
}

TEST_F(AtomicFileTest, WhatCannotHaveItsNameAnyMoreIsKeptUnderAnother)
{
  write_bytes(file("a.kept-1.txt"), "of before");
  AtomicFile made(file("a.txt"));
  made.write("hours of work", 13);
  std::filesystem::create_directory(file("a.txt"));
  try {
    made.commit();
    ADD_FAILURE() << "a folder cannot be replaced";
  } catch (const OutputError& error) {
    EXPECT_NE(std::string(error.what()).find("it is kept as '" + file("a.kept-2.txt").string() + "'"), std::string::npos)
        << error.what();
  }
  EXPECT_EQ(bytes_of_file(file("a.kept-2.txt")), "hours of work");
  EXPECT_EQ(bytes_of_file(file("a.kept-1.txt")), "of before");
}

TEST_F(AtomicFileTest, ALockIsNeverHeldTwice)
{
  std::atomic<int> num_holders = 0, most = 0, num_times = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      for (int round = 0; round < 1000; ++round) {
        const OutputLock lock(file("a.txt"));
        if (!lock.holder().empty()) continue;
        most = std::max(most.load(), ++num_holders);
        ++num_times;
        --num_holders;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(most, 1);
  EXPECT_GT(num_times, 100);
}

TEST_F(AtomicFileTest, ParallelThreadsAndProcessesNeverMix)
{
  constexpr int kNumWriters = 6, kNumRounds = 50;
  const auto write_many = [&](int writer) {
    for (int round = 0; round < kNumRounds; ++round) {
      atomic_write(file("a.txt"), std::string(20000, static_cast<char>('a' + writer)));
    }
  };
  std::vector<pid_t> children;
  for (int writer = 0; writer < kNumWriters / 2; ++writer) {
    const pid_t child = fork();
    if (child == 0) {
      write_many(writer);
      _exit(0);
    }
    children.push_back(child);
  }
  std::vector<std::thread> threads;
  for (int writer = kNumWriters / 2; writer < kNumWriters; ++writer) {
    threads.emplace_back(write_many, writer);
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  for (const pid_t child : children) {
    int status = -1;
    waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
  }
  const std::string bytes = bytes_of_file(file("a.txt"));
  EXPECT_EQ(bytes, std::string(20000, bytes.at(0)));
  EXPECT_EQ(files_in_folder(), std::vector<std::string>{"a.txt"});
}

}  // namespace relief
