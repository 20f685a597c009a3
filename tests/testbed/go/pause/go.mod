module robovast-testbed/pause

go 1.24
