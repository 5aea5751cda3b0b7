"""The live page: an arm in the browser that is seen moving, is given goals with a finger, and can be stopped.

``session.py`` moves the arm from a thread of its own, ``lease.py`` knows who controls it, ``orders.py`` what can be
asked of it; ``learning.py`` makes a controller where there is none yet; ``server.py`` brings it all to the pages.
"""
