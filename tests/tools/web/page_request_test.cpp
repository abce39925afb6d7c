// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/web/page_request.hpp"

#include <gtest/gtest.h>

namespace r4::tool::web {
namespace {

using RequestKind = PageRequest::Kind;

TEST(WebPageRequest, ReadsEveryKind) {
  EXPECT_EQ(page_request(R"({"type":"control","want":true})")->on, true);
  EXPECT_EQ(page_request(R"({"type":"record","on":false})")->kind, RequestKind::record);
  EXPECT_EQ(page_request(R"({"type":"alive","now":1234})")->now, 1234U);
  const auto command =
      page_request(R"({"type":"command","request":12,"board":3,"command":"O:358,1,1"})");
  ASSERT_TRUE(command);
  EXPECT_EQ(command->kind, RequestKind::command);
  EXPECT_EQ(command->request, 12U);
  EXPECT_EQ(command->board, 3U);
  EXPECT_EQ(command->command, "O:358,1,1");
  EXPECT_EQ(page_request(R"({"type":"arm","request":1,"board":0})")->kind, RequestKind::arm);
  EXPECT_EQ(page_request(R"({"type":"clear","request":1,"board":0})")->kind, RequestKind::clear);
}

TEST(WebPageRequest, AcceptsAStopInAnyForm) {
  for (const char* text : {R"({"type":"stop"})", R"({"type":"stop","request":7})",
                           R"({"type":"stop","request":"x"})", R"({"board":[],"type":"stop"})"}) {
    const auto request = page_request(text);
    ASSERT_TRUE(request) << text;
    EXPECT_EQ(request->kind, RequestKind::stop);
  }
}

TEST(WebPageRequest, RefusesInvalidRequests) {
  for (const std::string& text :
       {std::string(),
        std::string("{"),
        std::string("7"),
        std::string("[]"),
        std::string("{}"),
        std::string("null"),
        std::string(R"({"type":7})"),
        std::string(R"({"type":"stopp"})"),
        std::string(R"({"type":"control"})"),
        std::string(R"({"type":"control","want":1})"),
        std::string(R"({"type":"alive"})"),
        std::string(R"({"type":"alive","now":-1})"),
        std::string(R"({"type":"alive","now":1.5})"),
        std::string(R"({"type":"alive","now":1e300})"),
        std::string(R"({"type":"arm","request":1})"),
        std::string(R"({"type":"arm","board":0})"),
        std::string(R"({"type":"arm","request":1,"board":-1})"),
        std::string(R"({"type":"command","request":1,"board":0})"),
        std::string(R"({"type":"command","request":1,"board":0,"command":7})"),
        std::string(R"({"type":"command","request":1,"board":0,"command":""})"),
        R"({"type":"command","request":1,"board":0,"command":")" + std::string(1025, 'x') + "\"}",
        std::string(R"({"type":"stop"} x)"),
        std::string("\xff"),
        std::string(4000, '['),
        std::string(R"({"type":"stop)") + '\xff' + "\"}"}) {
    EXPECT_FALSE(page_request(text)) << text.substr(0, 80);
  }
}

}  // namespace
}  // namespace r4::tool::web
