module robovast-testbed/forward

go 1.24
