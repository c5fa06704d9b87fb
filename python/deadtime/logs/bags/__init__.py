"""Bags of messages, as robots write them: MCAP files and ROS bags, and any two fields as a loop."""

from deadtime.logs.bags._bag import Bag, BagTopic
from deadtime.logs.bags._open import is_bag, open_bag

__all__ = ["Bag", "BagTopic", "is_bag", "open_bag"]
