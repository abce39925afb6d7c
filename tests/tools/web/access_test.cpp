// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/web/server/access.hpp"

#include <gtest/gtest.h>

#include "r4link/error.hpp"

namespace r4::tool::web {
namespace {

const Access local("127.0.0.1", {}, "", {"https://app.example"});

TEST(WebAccess, ParsesTheListenAddress) {
  EXPECT_EQ(listen_address("127.0.0.1:8080").host, "127.0.0.1");
  EXPECT_EQ(listen_address("127.0.0.1:8080").port, 8080);
  EXPECT_EQ(listen_address("[::1]:80").host, "::1");
  EXPECT_EQ(listen_address("[::1]:80").text(), "[::1]:80");
  EXPECT_EQ(listen_address("robot:0").text(), "robot:0");
  for (const char* wrong : {"", ":", "8080", ":8080", "robot", "robot:", "robot:65536", "robot:-1",
                            "robot:80 ", "::1:80", "[::1]", "[::1:80", "robot:http"}) {
    EXPECT_THROW(listen_address(wrong), Error) << wrong;
  }
}

TEST(WebAccess, RecognizesLoopbackNames) {
  for (const char* host : {"127.0.0.1", "127.9.9.9", "::1", "localhost"})
    EXPECT_TRUE(is_loopback(host)) << host;
  for (const char* host :
       {"0.0.0.0", "::", "192.168.0.1", "localhost.evil.example", "127.0.0.1.evil.example", ""}) {
    EXPECT_FALSE(is_loopback(host)) << host;
  }
}

TEST(WebAccess, RefusesForeignHostNames) {
  for (const char* host : {"127.0.0.1:8080", "localhost", "LOCALHOST:1", "[::1]:8080"}) {
    EXPECT_EQ(local.check(host, ""), Verdict::allowed) << host;
  }
  for (const char* host :
       {"", "evil.example", "127.0.0.1.evil.example:8080", "192.168.0.1:8080", "localhost:x",
        "localhost:8080:9", "[::1", "[::1]x", "localhost:", "user@localhost"}) {
    EXPECT_EQ(local.check(host, ""), Verdict::wrong_host) << host;
  }
  const Access everywhere("0.0.0.0", {}, "secret", {});
  EXPECT_EQ(everywhere.check("10.1.2.3:8080", ""), Verdict::allowed);
  EXPECT_EQ(everywhere.check("[fe80::1]:8080", ""), Verdict::allowed);
  EXPECT_EQ(everywhere.check("robot.example:8080", ""), Verdict::wrong_host);
  EXPECT_EQ(Access("robot.example", {}, "secret", {}).check("Robot.example:8080", ""),
            Verdict::allowed);
}

TEST(WebAccess, RefusesPagesOfOtherSites) {
  EXPECT_EQ(local.check("localhost:8080", "http://localhost:8080"), Verdict::allowed);
  for (const char* origin :
       {"http://localhost", "http://localhost:8081", "https://localhost:8080", "null",
        "http://evil.example", "http://localhost:8080.evil.example", "https://app.example"}) {
    EXPECT_EQ(local.check("localhost:8080", origin), Verdict::wrong_origin) << origin;
  }
}

TEST(WebAccess, ParsesHostNames) {
  EXPECT_EQ(host_name("Robot.example"), "robot.example");
  EXPECT_EQ(host_name("robot.example:8443"), "robot.example:8443");
  for (const char* wrong : {"", "https://robot.example", "robot.example/", "robot.example:https",
                            "user@robot.example", "robot example"}) {
    EXPECT_THROW(host_name(wrong), Error) << wrong;
  }
}

// A proxy passes on the name that the browser requested, or uses its configured address.
TEST(WebAccess, ServesPagesUnderTheGivenNames) {
  const Access access("127.0.0.1", {"robot.example", "lab.example:8443"}, "secret", {});
  for (const char* host :
       {"robot.example", "Robot.Example:8080", "lab.example", "127.0.0.1:8080"}) {
    EXPECT_EQ(access.check(host, ""), Verdict::allowed) << host;
    for (const char* origin : {"https://robot.example", "http://robot.example",
                               "https://Lab.example:8443", "http://lab.example:8443"}) {
      EXPECT_EQ(access.check(host, origin), Verdict::allowed) << host << " " << origin;
    }
    for (const char* origin : {"https://lab.example", "https://robot.example:8443",
                               "https://robot.example.evil", "null", "ftp://robot.example"}) {
      EXPECT_EQ(access.check(host, origin), Verdict::wrong_origin) << host << " " << origin;
    }
  }
  EXPECT_EQ(access.check("evil.example", "https://robot.example"), Verdict::wrong_host);
}

TEST(WebAccess, ANamedForeignPageMayRead) {
  EXPECT_EQ(local.check_reader("localhost:8080", "https://app.example"), Verdict::allowed);
  EXPECT_EQ(local.check_reader("localhost:8080", "https://app.example.evil"),
            Verdict::wrong_origin);
  EXPECT_EQ(local.check_reader("evil.example", "https://app.example"), Verdict::wrong_host);
}

TEST(WebAccess, AcceptsOnlyTheExactTokenInAnyOfThreePositions) {
  const std::string token = random_token();
  EXPECT_EQ(token.size(), 32U);
  EXPECT_NE(token, random_token());
  const Access access("0.0.0.0", {}, token, {});
  EXPECT_EQ(access.check_token("Bearer " + token, "/", {}), Verdict::allowed);
  EXPECT_EQ(access.check_token("", "/live?token=" + token, {}), Verdict::allowed);
  EXPECT_EQ(access.check_token("", "/", {"r4.web.v1", "r4.token." + token}), Verdict::allowed);
  for (const std::string& wrong :
       {std::string(), token.substr(1), token + "0", std::string(32, '0')}) {
    EXPECT_EQ(access.check_token("Bearer " + wrong, "/?token=" + wrong, {"r4.token." + wrong}),
              Verdict::wrong_token);
  }
  EXPECT_EQ(access.check_token(token, "/" + token, {token}), Verdict::wrong_token);
  EXPECT_EQ(local.check_token("", "/", {}), Verdict::allowed);
}

}  // namespace
}  // namespace r4::tool::web
