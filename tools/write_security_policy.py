"""Write config/security/vergence.policy.xml from what the running nodes have; a test holds it equal to them."""

from pathlib import Path

from vergence_bringup.testing.ros.live_policies import live_policy

FILE = Path(__file__).resolve().parent.parent / "config" / "security" / "vergence.policy.xml"

if __name__ == "__main__":
    FILE.write_text(live_policy(), encoding="utf-8")
