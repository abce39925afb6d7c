// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include "tools/r4/watch/board_metrics.hpp"

namespace r4::tool {
namespace {

TEST(MetricFamilies, WritesEachFamilyOnceWithItsHelpAndType) {
  MetricFamilies families;
  families.gauge("r4_up", "It is heard.", {{"url", "udp://a"}}, 1);
  families.count("r4_lost_total", "Lost.", {{"url", "udp://a"}, {"path", "b"}}, 12U);
  families.gauge("r4_up", "It is heard.", {{"url", "udp://b"}}, 0.25);
  EXPECT_EQ(families.text(),
            "# HELP r4_lost_total Lost.\n"
            "# TYPE r4_lost_total counter\n"
            "r4_lost_total{url=\"udp://a\",path=\"b\"} 12\n"
            "# HELP r4_up It is heard.\n"
            "# TYPE r4_up gauge\n"
            "r4_up{url=\"udp://a\"} 1\n"
            "r4_up{url=\"udp://b\"} 0.25\n");
}

TEST(MetricFamilies, EscapesABoardNameInItsLabel) {
  MetricFamilies families;
  families.gauge("m", "h", {{"name", "a\"} 1\nb\\\xff"}}, 1);
  EXPECT_EQ(families.text(),
            "# HELP m h\n# TYPE m gauge\nm{name=\"a\\\"} 1\\\\x0ab\\\\\\\\xff\"} 1\n");
}

}  // namespace
}  // namespace r4::tool
