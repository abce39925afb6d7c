// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include "r4link/vocabulary.hpp"
#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::str;

TEST(Refusal, EveryCodeHasItsProtocolName) {
  const std::pair<Refusal, const char*> codes[] = {
      {Refusal::unknown, "UNKNOWN"}, {Refusal::format, "FORMAT"}, {Refusal::range, "RANGE"},
      {Refusal::channel, "CHANNEL"}, {Refusal::stale, "STALE"},   {Refusal::duplicate, "DUPLICATE"},
      {Refusal::safe, "SAFE"},       {Refusal::busy, "BUSY"},     {Refusal::auth, "AUTH"},
      {Refusal::full, "FULL"},
  };
  for (const auto& [code, name] : codes) {
    EXPECT_EQ(str(name_of(code)), name);
    EXPECT_EQ(refusal_from(std::string(name)), code);
  }
  EXPECT_EQ(str(name_of(Refusal::none)), "NONE");
  EXPECT_EQ(str(name_of(static_cast<Refusal>(200))), "NONE");
}

TEST(Refusal, UnknownNamesAreNone) {
  for (const std::string name : {"", "NONE", "range", "RANGE ", "RANG"}) {
    EXPECT_EQ(refusal_from(name), Refusal::none) << name;
  }
}

}  // namespace
}  // namespace r4
