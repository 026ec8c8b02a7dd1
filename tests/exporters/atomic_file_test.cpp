#include "exporters/atomic_file.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <thread>

#include "exporters/errors.h"
#include "tests/exporters/test_pictures.h"

namespace relief {

using AtomicFileTest = FolderTest;

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
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  AtomicFile file("/dev/full");
  file.write("x", 1);
  // The seek flushes, fails, and leaves nothing in the buffer that could fail again.
  EXPECT_THROW(file.seek(0), OutputError);
  EXPECT_THROW(file.commit(), OutputError);
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
